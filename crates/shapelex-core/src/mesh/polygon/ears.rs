//! Ear clipping: cut off a corner whose triangle lies within the polygon, until a triangle is left.
//!
//! Each cut joins the two neighbours of a corner, so the result is a triangulation of the border whatever the
//! polygon's shape: n − 2 triangles, each border edge in one of them. (The crates that clip ears, earcut and earcutr,
//! leave out corners on a straight border and around crossings, which would open the surface.)

use crate::cancel::{Cancel, Cancelled};

/// A budget of steps.
pub(super) struct Effort<'a> {
    left: u64,
    until_look: u64,
    cancel: &'a Cancel,
}

/// Steps between two looks at the stop flag.
const STRIDE: u64 = 1 << 20;

impl<'a> Effort<'a> {
    /// A budget of so many steps.
    pub fn new(steps: u64, cancel: &'a Cancel) -> Self {
        Self {
            left: steps,
            until_look: STRIDE,
            cancel,
        }
    }

    /// Whether nothing is left.
    pub fn is_spent(&self) -> bool {
        self.left == 0
    }

    /// Spends steps; false where too few are left.
    fn spend(&mut self, steps: u64) -> Result<bool, Cancelled> {
        if steps >= self.until_look {
            self.cancel.check()?;
            self.until_look = STRIDE;
        } else {
            self.until_look -= steps;
        }
        if steps > self.left {
            self.left = 0;
            return Ok(false);
        }
        self.left -= steps;
        Ok(true)
    }
}

/// Bytes taken for a polygon of n corners.
pub(super) fn bytes(n: usize) -> u64 {
    n as u64 * (2 * size_of::<u32>() + size_of::<bool>() + size_of::<[u32; 3]>()) as u64
}

/// Which corners are cut, from the best to the last resort. Thinness is twice the area over the longest edge's square.
#[derive(Clone, Copy)]
enum Accept {
    /// Thinness above the first number, with no other corner inside or closer to it than the second (as thinness).
    Clear(f64, f64),
    /// Thinness below the number: the corner is straight, a spike, or at its neighbour's place.
    Straight(f64),
    Any,
}

const TIERS: [Accept; 5] = [
    Accept::Clear(1e-2, 1e-6),
    Accept::Clear(1e-9, 1e-9),
    Accept::Clear(0.0, 0.0),
    Accept::Straight(1e-9),
    Accept::Any,
];

/// Triangles of a polygon, as numbers of its corners; its area must be positive. Where the effort does not suffice,
/// the remaining corners are cut in their order.
pub(super) fn triangulate(points: &[[f64; 2]], effort: &mut Effort<'_>) -> Result<Vec<[u32; 3]>, Cancelled> {
    let n = points.len();
    let mut ring = Ring::new(points);
    let mut triangles = Vec::with_capacity(n - 2);
    let (mut at, mut refused, mut tier) = (0, 0, 0);
    while ring.corners > 3 {
        // A corner is compared with all others.
        if !effort.spend(ring.corners as u64)? || ring.accepts(at, TIERS[tier]) {
            let next = ring.next[at];
            triangles.push(ring.cut(at));
            // Going on with the corner after the next spreads the cuts over the border.
            at = ring.next[next as usize] as usize;
            (refused, tier) = (0, 0);
        } else {
            at = ring.next[at] as usize;
            refused += 1;
            if refused == ring.corners {
                (refused, tier) = (0, tier + 1);
            }
        }
    }
    triangles.push(ring.triangle(at));
    Ok(triangles)
}

/// The corners not yet cut off.
struct Ring<'a> {
    points: &'a [[f64; 2]],
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Corners that bend inwards or not at all. An ear with another corner in it has one of these in it.
    reflex: Vec<bool>,
    corners: usize,
}

impl<'a> Ring<'a> {
    fn new(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        let mut ring = Self {
            points,
            next: (0..n as u32).map(|k| (k + 1) % n as u32).collect(),
            previous: (0..n as u32).map(|k| (k + n as u32 - 1) % n as u32).collect(),
            reflex: vec![false; n],
            corners: n,
        };
        for k in 0..n {
            ring.mark(k);
        }
        ring
    }

    fn triangle(&self, at: usize) -> [u32; 3] {
        [self.previous[at], at as u32, self.next[at]]
    }

    /// The corner's triangle, its doubled area and its longest edge's square.
    fn shape(&self, at: usize) -> ([[f64; 2]; 3], f64, f64) {
        let [a, b, c] = self.triangle(at).map(|k| self.points[k as usize]);
        let square = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
        let longest = square(a, b).max(square(b, c)).max(square(c, a));
        ([a, b, c], doubled_area(a, b, c), longest)
    }

    fn mark(&mut self, at: usize) {
        let (_, area, longest) = self.shape(at);
        self.reflex[at] = area <= 1e-6 * longest;
    }

    fn cut(&mut self, at: usize) -> [u32; 3] {
        let triangle = self.triangle(at);
        let [before, _, after] = triangle.map(|k| k as usize);
        self.next[before] = after as u32;
        self.previous[after] = before as u32;
        self.corners -= 1;
        self.mark(before);
        self.mark(after);
        triangle
    }

    fn accepts(&self, at: usize, accept: Accept) -> bool {
        let ([a, b, c], area, longest) = self.shape(at);
        match accept {
            Accept::Any => true,
            Accept::Straight(most) => area.abs() <= most * longest,
            Accept::Clear(least, margin) => {
                if area <= least * longest {
                    return false;
                }
                // Strictly inside where there is no margin.
                let edge = -margin * longest;
                let inside = |x: f64| if margin > 0.0 { x >= edge } else { x > 0.0 };
                let last = self.previous[at] as usize;
                let mut other = self.next[self.next[at] as usize] as usize;
                while other != last {
                    let p = self.points[other];
                    if self.reflex[other]
                        && inside(doubled_area(c, a, p))
                        && inside(doubled_area(a, b, p))
                        && inside(doubled_area(b, c, p))
                        && p != a
                        && p != b
                        && p != c
                    {
                        return false;
                    }
                    other = self.next[other] as usize;
                }
                true
            }
        }
    }
}

/// Twice the area of a triangle, positive where it turns counter-clockwise.
fn doubled_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
