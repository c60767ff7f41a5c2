//! Which side of a surface is outside.

use super::edges::for_each_edge;
use super::orient::orient;
use super::trimesh::face_area;
use super::work::Unwatched;

/// What is known of the faces that hang together across edges of two faces.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    open: bool,
    /// Six times the volume enclosed, negative where the faces run inwards.
    volume: f64,
    /// Area of the faces that kept their direction less that of those that were reversed.
    kept: f64,
}

/// The faces, reversed where they must be so that neighbours run the same way round and normals point outwards.
///
/// Of a part of the surface without boundary the enclosed volume tells which side is outside; of one with a boundary
/// the direction that most of its area had. On a surface that cannot be oriented a line of disagreement is left.
pub fn outward_faces(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut oriented = faces.to_vec();
    let Ok(()) = orient(vertices.len(), &mut oriented, &Unwatched);
    let part_of = parts(vertices.len(), &oriented);
    let mut summed = vec![Part::default(); faces.len()];
    for (f, (face, given)) in oriented.iter().zip(faces).enumerate() {
        let part = &mut summed[part_of[f] as usize];
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        part.volume += a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        let area = face_area(vertices, face);
        part.kept += if face == given { area } else { -area };
    }
    let Ok(()) = for_each_edge(vertices.len(), &oriented, &Unwatched, |_, _, group| {
        if let [only] = *group {
            summed[part_of[(only >> 1) as usize / 3] as usize].open = true;
        }
    });
    for (f, face) in oriented.iter_mut().enumerate() {
        let part = summed[part_of[f] as usize];
        let inwards = if part.open {
            part.kept < 0.0
        } else {
            part.volume < 0.0
        };
        if inwards {
            face.swap(1, 2);
        }
    }
    oriented
}

/// For each face the first face that it hangs together with across edges of two faces.
fn parts(vertex_count: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    fn root(of: &mut [u32], mut f: u32) -> u32 {
        while of[f as usize] != f {
            of[f as usize] = of[of[f as usize] as usize];
            f = of[f as usize];
        }
        f
    }
    let mut of: Vec<u32> = (0..faces.len() as u32).collect();
    let Ok(()) = for_each_edge(vertex_count, faces, &Unwatched, |_, _, group| {
        if let [x, y] = *group {
            let (a, b) = (root(&mut of, (x >> 1) / 3), root(&mut of, (y >> 1) / 3));
            of[a.max(b) as usize] = a.min(b);
        }
    });
    (0..faces.len() as u32).map(|f| root(&mut of, f)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const OUTWARDS: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    #[test]
    fn a_closed_surface_is_turned_outwards_whichever_way_its_faces_run() {
        for reversed in 0..16u32 {
            let faces: Vec<[u32; 3]> = OUTWARDS
                .iter()
                .enumerate()
                .map(|(f, &[a, b, c])| {
                    if reversed >> f & 1 == 1 {
                        [a, c, b]
                    } else {
                        [a, b, c]
                    }
                })
                .collect();
            assert_eq!(outward_faces(&CORNERS, &faces), OUTWARDS, "{reversed:04b}");
        }
    }

    #[test]
    fn an_open_surface_keeps_the_direction_of_most_of_its_area() {
        let outwards = OUTWARDS[..3].to_vec();
        let inwards = outwards.iter().map(|&[a, b, c]| [a, c, b]).collect::<Vec<_>>();
        // The third face has 0.87 of the area, the first two 0.5 each.
        let two_inwards = [inwards[0], inwards[1], outwards[2]];
        assert_eq!(outward_faces(&CORNERS, &two_inwards), inwards);
        let one_inwards = [inwards[0], outwards[1], outwards[2]];
        assert_eq!(outward_faces(&CORNERS, &one_inwards), outwards);
    }
}
