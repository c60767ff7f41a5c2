//! Points sorted into the cells of a regular grid, for the search of those near a place.

/// Cells along a side at most: a long and thin shape has larger cells.
const MOST_CELLS: usize = 64;

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub place: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
}

/// Points in the order of their cells, x fastest.
pub(super) struct Cells {
    low: [f32; 3],
    scale: f32,
    sides: [usize; 3],
    /// Where each cell's points start, and the end of the last.
    start: Vec<u32>,
    /// x, y, z of the places and of the normals, each by itself for wide registers.
    values: [Vec<f32>; 6],
}

impl Cells {
    /// Cells half as wide as the radius that is searched.
    pub fn new(points: impl Iterator<Item = Point> + Clone, radius: f64) -> Self {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for point in points.clone() {
            for k in 0..3 {
                low[k] = low[k].min(point.place[k]);
                high[k] = high[k].max(point.place[k]);
            }
        }
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
        let width = (0.5 * radius as f32)
            .max(extent / MOST_CELLS as f32)
            .max(f32::MIN_POSITIVE);
        let scale = 1.0 / width;
        let sides = std::array::from_fn(|k| (((high[k] - low[k]) * scale) as usize + 1).min(MOST_CELLS + 1));
        let mut cells = Self {
            low,
            scale,
            sides,
            start: vec![0; sides.iter().product::<usize>() + 2],
            values: Default::default(),
        };
        let numbers: Vec<u32> = points.clone().map(|p| cells.number(p.place)).collect();
        for &number in &numbers {
            cells.start[number as usize + 2] += 1;
        }
        for i in 1..cells.start.len() {
            cells.start[i] += cells.start[i - 1];
        }
        cells.values = std::array::from_fn(|_| vec![0.0; numbers.len()]);
        for (point, number) in points.zip(numbers) {
            let slot = &mut cells.start[number as usize + 1];
            for k in 0..3 {
                cells.values[k][*slot as usize] = point.place[k];
                cells.values[k + 3][*slot as usize] = point.normal[k];
            }
            *slot += 1;
        }
        cells
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.values[0].len()
    }

    fn along(&self, k: usize, x: f32) -> usize {
        // A cast from below 0 gives 0.
        (((x - self.low[k]) * self.scale) as usize).min(self.sides[k] - 1)
    }

    fn number(&self, place: [f32; 3]) -> u32 {
        let [x, y, z] = std::array::from_fn(|k| self.along(k, place[k]));
        ((z * self.sides[1] + y) * self.sides[0] + x) as u32
    }

    /// The points of all cells that a ball touches, and some more, a run of cells at a time: x, y, z of their places and of
    /// their normals.
    #[inline(always)]
    pub fn each_near(&self, place: [f32; 3], radius: f32, mut visit: impl FnMut([&[f32]; 6])) {
        let reach: [(usize, usize); 3] =
            std::array::from_fn(|k| (self.along(k, place[k] - radius), self.along(k, place[k] + radius)));
        for z in reach[2].0..=reach[2].1 {
            for y in reach[1].0..=reach[1].1 {
                let row = (z * self.sides[1] + y) * self.sides[0];
                let from = self.start[row + reach[0].0] as usize;
                let to = self.start[row + reach[0].1 + 1] as usize;
                if from < to {
                    visit(std::array::from_fn(|k| &self.values[k][from..to]));
                }
            }
        }
    }
}
