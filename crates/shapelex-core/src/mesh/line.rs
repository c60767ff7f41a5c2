//! Taking out all the slivers of one line in one step.
//!
//! Let K be the slivers near a line and let their vertices be ordered along it. Each edge of K that a face outside K uses is
//! split at the vertices of K between its ends, and K is dropped. The edges that K shared with faces outside form closed
//! walks over the line, and a closed walk passes each interval between neighbouring vertices an even number of times. So
//! modulo 2 the surface has the same border as before, wherever the vertices lie and whatever their order is.

use super::boundary::distance;
use super::patch::{Allowed, Outcome, Patch, Reach, sorted};
use super::sliver::{CAP, Shape, shape};
use std::collections::{BTreeMap, HashMap, HashSet};

/// Faces that one step may make for each face it takes away.
const MOST_GROWTH: usize = 4;

/// The slivers of a line.
struct Line {
    members: Vec<u32>,
    is_member: HashSet<u32>,
    /// Place along the line of each vertex that faces outside use.
    rank: HashMap<u32, usize>,
    /// Those vertices by place.
    along: Vec<u32>,
}

/// A face outside that has an edge of the line, and the faces it becomes.
struct Split {
    face: u32,
    halves: Vec<[u32; 3]>,
}

/// New faces by their corners in ascending order; those that are there twice are gone.
type New = BTreeMap<[u32; 3], [u32; 3]>;

impl Patch<'_> {
    /// Takes out a cap, and with it the slivers on its line, where that makes fewer caps or shorter ones.
    pub(super) fn open_cap(&mut self, cap: u32, base: [u32; 2], reach: Reach, allowed: Allowed) -> Outcome {
        let Some(line) = self.line(cap, base, reach) else {
            return Outcome::Blocked;
        };
        let Some((splits, edges_outside)) = self.splits(&line) else {
            return Outcome::Blocked;
        };
        if edges_outside <= 1 {
            return self.drop_members(&line, edges_outside);
        }
        let gone: HashSet<u32> = splits.iter().map(|s| s.face).collect();
        let is_gone = |f: &u32| line.is_member.contains(f) || gone.contains(f);
        let mut new = New::new();
        let mut twins: Vec<u32> = Vec::new();
        for half in splits.iter().flat_map(|s| &s.halves) {
            let key = sorted(*half);
            let Some(there) = self.sharing_two_of(&line, half) else {
                return Outcome::Blocked;
            };
            let twin = (there.iter().copied()).find(|f| {
                !is_gone(f) && !twins.contains(f) && self.faces[*f as usize].is_some_and(|g| sorted(g) == key)
            });
            let folds = twin.is_some() || new.contains_key(&key);
            if folds && shape(&self.vertices, half).0 == Shape::Sound {
                return Outcome::Blocked;
            }
            match twin {
                Some(twin) => twins.push(twin),
                None if new.remove(&key).is_none() => {
                    new.insert(key, *half);
                }
                None => {}
            }
        }
        let stays = |f: &u32| !is_gone(f) && !twins.contains(f);
        if allowed == Allowed::Manifold && !self.keeps_manifold(&new, stays) {
            return Outcome::Blocked;
        }
        let split = splits.iter().map(|s| &s.face);
        let before: Vec<[u32; 3]> = (line.members.iter().chain(split).chain(&twins))
            .filter_map(|f| self.faces[*f as usize])
            .collect();
        if !self.is_progress(&before, &new) {
            return Outcome::Blocked;
        }
        for face in line.members.iter().chain(&twins) {
            self.remove(*face);
        }
        for split in splits {
            let left = split
                .halves
                .into_iter()
                .filter(|h| new.remove(&sorted(*h)).is_some());
            self.replace_by(split.face, left.collect());
        }
        Outcome::Joined
    }

    /// Slivers that at most one edge joins to the faces outside.
    fn drop_members(&mut self, line: &Line, edges_outside: usize) -> Outcome {
        debug_assert!(edges_outside <= 1);
        for face in &line.members {
            self.remove(*face);
        }
        Outcome::Loose {
            faces: line.members.len(),
        }
    }

    /// The slivers that edges join to a cap and whose vertices are as near to its base's line as its own corner may be;
    /// `None` where not all faces at the cap are known.
    fn line(&mut self, cap: u32, [a, b]: [u32; 2], reach: Reach) -> Option<Line> {
        let corners = self.faces[cap as usize]?;
        if !corners.iter().all(|v| self.complete[*v as usize]) {
            return None;
        }
        let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
        let direction: [f64; 3] = std::array::from_fn(|k| q[k] - p[k]);
        let square: f64 = direction.iter().map(|x| x * x).sum();
        let mut members = vec![cap];
        let mut is_member = HashSet::from([cap]);
        let mut vertices = corners.to_vec();
        let mut known = HashSet::from(corners);
        let mut next = 0;
        while reach == Reach::Connected && next < members.len() {
            let corners = self.faces[members[next] as usize]?;
            next += 1;
            for k in 0..3 {
                for face in self.sharing(corners[k], corners[(k + 1) % 3])? {
                    let Some(others) = self.faces[face as usize] else {
                        continue;
                    };
                    let near = |v: &u32| {
                        known.contains(v)
                            || (self.complete[*v as usize]
                                && off_line(&self.vertices[*v as usize], &p, &direction)
                                    <= CAP * CAP * square)
                    };
                    if is_member.contains(&face) || !self.is_sliver(face) || !others.iter().all(near) {
                        continue;
                    }
                    is_member.insert(face);
                    members.push(face);
                    vertices.extend(others.into_iter().filter(|v| known.insert(*v)));
                }
            }
        }
        // A face between three vertices of the line lies on it.
        for v in &vertices {
            self.visits += self.faces_of[*v as usize].len();
            for face in &self.faces_of[*v as usize] {
                let on_line = self.faces[*face as usize].is_some_and(|f| f.iter().all(|v| known.contains(v)));
                if on_line && is_member.insert(*face) {
                    members.push(*face);
                }
            }
        }
        // A corner that no face outside uses need not stay.
        vertices.retain(|v| self.faces_of[*v as usize].iter().any(|f| !is_member.contains(f)));
        let place = |v: &u32| -> f64 {
            let at = self.vertices[*v as usize];
            (0..3).map(|k| (at[k] - p[k]) * direction[k]).sum()
        };
        vertices.sort_by(|v, w| place(v).total_cmp(&place(w)).then(v.cmp(w)));
        Some(Line {
            members,
            is_member,
            rank: vertices.iter().enumerate().map(|(i, v)| (*v, i)).collect(),
            along: vertices,
        })
    }

    /// What becomes of the faces outside a line that have an edge of its members, and how many such edges there are; `None`
    /// where the faces would be too many.
    fn splits(&mut self, line: &Line) -> Option<(Vec<Split>, usize)> {
        let corners = line.members.iter().filter_map(|f| self.faces[*f as usize]);
        let mut edges: Vec<[u32; 2]> = corners
            .flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut splits = Vec::new();
        let (mut edges_outside, mut made, mut taken) = (0, 0, line.members.len());
        for [a, b] in edges {
            let outside = self.sharing(a, b)?;
            let outside: Vec<u32> = outside
                .into_iter()
                .filter(|f| !line.is_member.contains(f))
                .collect();
            if outside.is_empty() {
                continue;
            }
            edges_outside += 1;
            let (i, j) = (*line.rank.get(&a)?, *line.rank.get(&b)?);
            if i.abs_diff(j) == 1 {
                continue;
            }
            taken += outside.len();
            made += outside.len() * i.abs_diff(j);
            if made > MOST_GROWTH * taken {
                return None;
            }
            let [from, to] = if i < j { [a, b] } else { [b, a] };
            let path = &line.along[i.min(j)..=i.max(j)];
            for face in outside {
                let corners = self.faces[face as usize]?;
                let half = |pair: &[u32]| {
                    corners.map(|v| match v {
                        v if v == from => pair[0],
                        v if v == to => pair[1],
                        v => v,
                    })
                };
                splits.push(Split {
                    face,
                    halves: path.windows(2).map(half).collect(),
                });
            }
        }
        Some((splits, edges_outside))
    }

    /// The faces that have the two corners of a face that lie on a line.
    fn sharing_two_of(&mut self, line: &Line, face: &[u32; 3]) -> Option<Vec<u32>> {
        let mut on_line = face.iter().filter(|v| line.rank.contains_key(v));
        let (a, b) = (*on_line.next()?, *on_line.next()?);
        self.sharing(a, b)
    }

    /// Whether the edges of new faces have at most two faces.
    fn keeps_manifold(&mut self, new: &New, stays: impl Fn(&u32) -> bool) -> bool {
        let mut count: HashMap<[u32; 2], usize> = HashMap::new();
        for face in new.keys() {
            for [a, b] in [[face[0], face[1]], [face[1], face[2]], [face[0], face[2]]] {
                *count.entry([a, b]).or_default() += 1;
            }
        }
        count.into_iter().all(|([a, b], n)| match self.sharing(a, b) {
            Some(there) => n + there.iter().filter(|f| stays(f)).count() <= 2,
            // An edge of a face that is split, which has as many as before.
            None => true,
        })
    }

    /// Whether there are fewer caps than before, or as many with shorter edges. Needles do not count, as closing one leaves a
    /// vertex less: so this comes to an end.
    fn is_progress(&self, before: &[[u32; 3]], new: &New) -> bool {
        /// Rounding is much less than this.
        const SHORTER: f64 = 1.0 - 1e-9;
        let is_cap = |f: &[u32; 3]| matches!(shape(&self.vertices, f).0, Shape::Cap { .. });
        let length = |v: u32, w: u32| distance(&self.vertices[v as usize], &self.vertices[w as usize]);
        let around = |f: &[u32; 3]| length(f[0], f[1]) + length(f[1], f[2]) + length(f[2], f[0]);
        let caps = before.iter().filter(|f| is_cap(f)).count();
        let caps_left = new.values().filter(|f| is_cap(f)).count();
        caps_left < caps
            || (caps_left == caps
                && new.keys().map(around).sum::<f64>() < SHORTER * before.iter().map(around).sum::<f64>())
    }
}

/// The square of a point's distance from the line through `origin`.
fn off_line(point: &[f64; 3], origin: &[f64; 3], direction: &[f64; 3]) -> f64 {
    let v: [f64; 3] = std::array::from_fn(|k| point[k] - origin[k]);
    let cross = [
        v[1] * direction[2] - v[2] * direction[1],
        v[2] * direction[0] - v[0] * direction[2],
        v[0] * direction[1] - v[1] * direction[0],
    ];
    let square: f64 = direction.iter().map(|x| x * x).sum();
    cross.iter().map(|x| x * x).sum::<f64>() / square
}
