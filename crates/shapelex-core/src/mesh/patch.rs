//! The faces around slivers, and the two changes that take a sliver out.

use super::MeshError;
use super::sliver::{Shape, shape};
use super::work::{Watch, Work};
use crate::memory::Held;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Faces of a patch at most.
pub(super) const MOST_FACES: usize = 500_000;

/// Bytes that a patch takes for each vertex and for each face.
const BYTES: [usize; 2] = [110, 80];

/// Faces that may be looked through in all: 64 for each face of the patch, and some more so that small patches are free to
/// have a vertex with many slivers, which takes time that grows with their square.
const VISITS_OF_FACE: usize = 64;
const MORE_VISITS: usize = 1 << 25;

/// What became of a sliver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Its vertices were joined to the faces around.
    Joined,
    /// It joined nothing and was taken out, with others on its line.
    Loose { faces: usize },
    /// It could not be taken out.
    Blocked,
}

/// How far a change may go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Allowed {
    /// Edges with two faces stay edges with two faces.
    Manifold,
    /// A new edge may be where there is one already.
    SharedEdges,
}

/// How many of the slivers near a line are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// All that edges of others lead to.
    Connected,
    /// Only one.
    Single,
}

/// A sliver in the queue, the longest first, ties by place. Stale where the face has other corners now.
type Entry = (u64, Reverse<[u32; 3]>, Reverse<u32>);

/// Vertices are numbered by place, and the faces of each are known: of the slivers' vertices all, of others some.
pub(super) struct Patch<'a> {
    pub(super) vertices: Vec<[f64; 3]>,
    /// Index in the mesh of each vertex here.
    origin: Vec<u32>,
    /// Whether all faces of a vertex are in the patch.
    pub(super) complete: Vec<bool>,
    pub(super) faces_of: Vec<Vec<u32>>,
    pub(super) faces: Vec<Option<[u32; 3]>>,
    /// Index in the mesh of each face here; those beyond are new.
    place: Vec<u32>,
    queue: BinaryHeap<Entry>,
    pub(super) visits: usize,
    work: Work<'a>,
    _held: (Held<'a>, Held<'a>),
}

impl<'a> Patch<'a> {
    /// The faces at the vertices of `slivers`; `None` where there are too many.
    pub fn around(
        vertices: &[[f64; 3]],
        faces: &[[u32; 3]],
        slivers: &[u32],
        work: Work<'a>,
    ) -> Result<Option<Self>, MeshError> {
        const AT_SLIVER: u32 = 1;
        let _held = work.hold(vertices.len(), 4)?;
        let mut mark = vec![0u32; vertices.len()];
        for &s in slivers {
            for v in faces[s as usize] {
                mark[v as usize] = AT_SLIVER;
            }
        }
        let touches = |f: &[u32; 3]| f.iter().any(|v| mark[*v as usize] == AT_SLIVER);
        let mut count = 0;
        for (i, f) in faces.iter().enumerate() {
            work.look(i)?;
            count += usize::from(touches(f));
        }
        if count > MOST_FACES {
            return Ok(None);
        }
        let place: Vec<u32> = (0..faces.len() as u32)
            .filter(|i| touches(&faces[*i as usize]))
            .collect();
        let mut origin: Vec<u32> = place.iter().flat_map(|i| faces[*i as usize]).collect();
        origin.sort_unstable();
        origin.dedup();
        let held = (work.hold(origin.len(), BYTES[0])?, work.hold(count, BYTES[1])?);
        let at = |v: u32| vertices[v as usize];
        origin.sort_by(|&a, &b| at(a).partial_cmp(&at(b)).unwrap_or(std::cmp::Ordering::Equal));
        let complete = origin.iter().map(|v| mark[*v as usize] == AT_SLIVER).collect();
        for (here, v) in origin.iter().enumerate() {
            mark[*v as usize] = here as u32;
        }
        let mut patch = Self {
            vertices: origin.iter().map(|v| at(*v)).collect(),
            faces_of: vec![Vec::new(); origin.len()],
            origin,
            complete,
            faces: Vec::with_capacity(count),
            place,
            queue: BinaryHeap::new(),
            visits: 0,
            work,
            _held: held,
        };
        for i in 0..count {
            let corners = faces[patch.place[i] as usize].map(|v| mark[v as usize]);
            patch.add(corners);
        }
        Ok(Some(patch))
    }

    /// Takes out slivers until none is left that can be, and reports each outcome but those that are tried again.
    pub fn run(&mut self, mut report: impl FnMut(Outcome)) -> Result<(), MeshError> {
        let most_visits = VISITS_OF_FACE * self.faces.len() + MORE_VISITS;
        let mut allowed = Allowed::Manifold;
        loop {
            let (mut blocked, mut progress) = (Vec::new(), false);
            while let Some(entry) = self.queue.pop() {
                if self.visits > most_visits {
                    return Ok(());
                }
                self.work.check()?;
                let (_, _, Reverse(face)) = entry;
                if !self.is_current(entry) {
                    continue;
                }
                match self.take_out(face, allowed) {
                    Outcome::Blocked => blocked.push(entry),
                    outcome => {
                        progress = true;
                        report(outcome);
                    }
                }
            }
            if blocked.is_empty() || (!progress && allowed == Allowed::SharedEdges) {
                return Ok(());
            }
            if !progress {
                allowed = Allowed::SharedEdges;
            }
            self.queue.extend(blocked);
        }
    }

    /// Writes the faces back.
    pub fn finish(self, faces: &mut Vec<[u32; 3]>) {
        const GONE: [u32; 3] = [0; 3];
        let known = self.place.len();
        for (i, face) in self.faces.iter().enumerate() {
            let corners = face.map_or(GONE, |f| f.map(|v| self.origin[v as usize]));
            if i < known {
                faces[self.place[i] as usize] = corners;
            } else {
                faces.push(corners);
            }
        }
        faces.retain(|f| *f != GONE);
    }

    fn is_current(&self, (_, Reverse(corners), Reverse(face)): Entry) -> bool {
        self.faces[face as usize].is_some_and(|f| sorted(f) == corners)
    }

    fn add(&mut self, corners: [u32; 3]) {
        let face = self.faces.len() as u32;
        self.faces.push(Some(corners));
        self.enter(face, corners);
    }

    /// Puts a face into the lists of its vertices, and into the queue where it is a sliver.
    fn enter(&mut self, face: u32, corners: [u32; 3]) {
        for v in corners {
            self.faces_of[v as usize].push(face);
        }
        let (kind, longest) = shape(&self.vertices, &corners);
        if kind != Shape::Sound {
            self.queue
                .push((longest.to_bits(), Reverse(sorted(corners)), Reverse(face)));
        }
    }

    pub(super) fn remove(&mut self, face: u32) {
        if let Some(corners) = self.faces[face as usize].take() {
            for v in corners {
                let list = &mut self.faces_of[v as usize];
                self.visits += list.len();
                list.retain(|f| *f != face);
            }
        }
    }

    fn replace(&mut self, face: u32, corners: [u32; 3]) {
        self.remove(face);
        self.faces[face as usize] = Some(corners);
        self.enter(face, corners);
    }

    /// Puts other faces in a face's place.
    pub(super) fn replace_by(&mut self, face: u32, others: Vec<[u32; 3]>) {
        self.remove(face);
        for (i, corners) in others.into_iter().enumerate() {
            if i == 0 {
                self.replace(face, corners);
            } else {
                self.add(corners);
            }
        }
    }

    fn take_out(&mut self, face: u32, allowed: Allowed) -> Outcome {
        let Some(corners) = self.faces[face as usize] else {
            return Outcome::Blocked;
        };
        match shape(&self.vertices, &corners).0 {
            Shape::Sound => Outcome::Blocked,
            Shape::Cap { base } => match self.open_cap(face, base, Reach::Connected, allowed) {
                Outcome::Blocked => self.open_cap(face, base, Reach::Single, allowed),
                outcome => outcome,
            },
            Shape::Needle { edge } => self.close_needle(edge),
        }
    }

    /// The faces that have both vertices; `None` where they are not all known.
    pub(super) fn sharing(&mut self, a: u32, b: u32) -> Option<Vec<u32>> {
        let list = match (self.complete[a as usize], self.complete[b as usize]) {
            (true, true) if self.faces_of[a as usize].len() > self.faces_of[b as usize].len() => b,
            (true, _) => a,
            (false, true) => b,
            (false, false) => return None,
        };
        let other = if list == a { b } else { a };
        let list = &self.faces_of[list as usize];
        self.visits += list.len();
        let has = |f: &&u32| self.faces[**f as usize].is_some_and(|f| f.contains(&other));
        Some(list.iter().filter(has).copied().collect())
    }

    /// The vertex of a face that is neither `a` nor `b`.
    fn apex(&self, face: u32, a: u32, b: u32) -> Option<u32> {
        self.faces[face as usize]?
            .into_iter()
            .find(|v| *v != a && *v != b)
    }

    pub(super) fn is_sliver(&self, face: u32) -> bool {
        self.faces[face as usize].is_some_and(|f| shape(&self.vertices, &f).0 != Shape::Sound)
    }

    /// Merges the ends of an edge where that keeps the surface around as it is (the link condition).
    fn close_needle(&mut self, edge: [u32; 2]) -> Outcome {
        let [kept, gone] = [edge[0].min(edge[1]), edge[0].max(edge[1])];
        if !self.complete[kept as usize] || !self.complete[gone as usize] {
            return Outcome::Blocked;
        }
        let Some(between) = self.sharing(kept, gone) else {
            return Outcome::Blocked;
        };
        let mut apexes: Vec<u32> = between.iter().filter_map(|f| self.apex(*f, kept, gone)).collect();
        apexes.sort_unstable();
        let (near, far) = (self.neighbours(kept), self.neighbours(gone));
        let common = near.ids.iter().filter(|v| far.ids.binary_search(v).is_ok());
        if !common.eq(apexes.iter()) || (between.len() > 1 && near.on_border && far.on_border) {
            return Outcome::Blocked;
        }
        let moved: Vec<(u32, [u32; 3])> = self.faces_of[gone as usize]
            .iter()
            .filter(|f| !between.contains(f))
            .filter_map(|f| Some((*f, self.faces[*f as usize]?)))
            .map(|(f, corners)| (f, corners.map(|v| if v == gone { kept } else { v })))
            .collect();
        // A face may become one that is there already only where both of its other corners are apexes.
        let folds = moved.iter().any(|(_, corners)| {
            let mut others = corners.iter().filter(|v| **v != kept);
            others.all(|v| apexes.binary_search(v).is_ok())
                && self.faces_of[kept as usize]
                    .iter()
                    .any(|g| self.faces[*g as usize].is_some_and(|g| sorted(g) == sorted(*corners)))
        });
        if folds {
            return Outcome::Blocked;
        }
        for face in between {
            self.remove(face);
        }
        for (face, corners) in moved {
            self.replace(face, corners);
        }
        Outcome::Joined
    }

    fn neighbours(&mut self, v: u32) -> Neighbours {
        let list = &self.faces_of[v as usize];
        self.visits += 2 * list.len();
        let mut all: Vec<u32> = list
            .iter()
            .filter_map(|f| self.faces[*f as usize])
            .flatten()
            .filter(|w| *w != v)
            .collect();
        all.sort_unstable();
        let on_border = all.chunk_by(|x, y| x == y).any(|faces| faces.len() == 1);
        all.dedup();
        Neighbours { ids: all, on_border }
    }
}

/// The vertices that share a face with one, ascending, and whether that one lies on a border.
struct Neighbours {
    ids: Vec<u32>,
    on_border: bool,
}

/// The corners of a face in ascending order.
pub(super) fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}
