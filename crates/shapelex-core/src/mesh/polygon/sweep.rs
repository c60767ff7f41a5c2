//! Triangulation of a simple polygon in n log n: a sweep cuts it into monotone pieces (de Berg et al., Computational
//! Geometry, chapter 3), each of which is triangulated in one pass.
//!
//! Orientations are exact (the crate `robust`), so a simple polygon cannot lead the sweep astray. One that crosses or
//! touches itself can; the outcome is checked, and `None` returned where it is not a triangulation.

use super::super::MeshError;
use crate::cancel::Cancel;
use robust::{Coord, orient2d};
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Corners between two looks at the stop flag.
const STRIDE: usize = 4096;

/// Bytes taken for a polygon of n corners, as measured.
pub(super) fn bytes(n: usize) -> u64 {
    n as u64 * 160
}

/// Triangles of a polygon, as numbers of its corners; its area must be positive. `None` where it is not simple.
///
/// Errors: [`MeshError::Cancelled`].
pub(super) fn triangulate(points: &[[f64; 2]], cancel: &Cancel) -> Result<Option<Vec<[u32; 3]>>, MeshError> {
    let n = points.len();
    let plane = Plane::new(points);
    let Some(diagonals) = plane.diagonals(cancel)? else {
        return Ok(None);
    };
    let mut pieces = Pieces::new(n, diagonals.len());
    for &[a, b] in &diagonals {
        pieces.split(a, b, &plane);
    }
    cancel.check()?;
    let Some(triangles) = pieces.triangulate(&plane, cancel)? else {
        return Ok(None);
    };
    cancel.check()?;
    Ok(plane.is_triangulation(&triangles).then_some(triangles))
}

/// The corners and the order in which the sweep meets them.
struct Plane<'a> {
    points: &'a [[f64; 2]],
    /// For each corner its place in the order by x, then y, then number.
    rank: Vec<u32>,
    order: Vec<u32>,
}

/// An edge that bounds the interior from below, by its corners in the order of the sweep; or one corner, twice.
struct Edge<'a> {
    plane: &'a Plane<'a>,
    left: u32,
    right: u32,
}

impl Edge<'_> {
    /// Whether this edge passes below (`Less`) or above a corner.
    fn side(&self, corner: u32) -> Ordering {
        let turn = self.plane.turn(self.left, self.right, corner);
        0f64.total_cmp(&(turn + 0.0))
    }
}

impl Ord for Edge<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        let number = (self.left, self.right).cmp(&(other.left, other.right));
        if number == Ordering::Equal {
            return number;
        }
        // The edge that began first is compared with the ends of the other.
        let first = self.plane.rank[self.left as usize] <= self.plane.rank[other.left as usize];
        let side = if first {
            self.side(other.left).then_with(|| self.side(other.right))
        } else {
            let turned = other.side(self.left).then_with(|| other.side(self.right));
            turned.reverse()
        };
        side.then(number)
    }
}

impl PartialOrd for Edge<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Edge<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Edge<'_> {}

/// A corner the sweep connects an edge's next event with.
#[derive(Clone, Copy)]
struct Helper {
    corner: u32,
    merges: bool,
}

/// The edges the sweep line crosses from below the interior, each with its helper.
struct Status<'a> {
    plane: &'a Plane<'a>,
    edges: BTreeMap<Edge<'a>, Helper>,
    diagonals: Vec<[u32; 2]>,
}

impl<'a> Status<'a> {
    fn start(&mut self, corner: u32, next: u32) {
        let edge = self.edge(corner, next);
        let helper = Helper {
            corner,
            merges: false,
        };
        self.edges.insert(edge, helper);
    }

    /// Ends the edge that leads to a corner; `None` where there is no such edge.
    fn end(&mut self, previous: u32, corner: u32) -> Option<()> {
        let helper = self.edges.remove(&self.edge(previous, corner))?;
        if helper.merges {
            self.diagonals.push([corner, helper.corner]);
        }
        Some(())
    }

    /// Makes a corner the helper of the edge below it, connected with the helper before where that one merges or where
    /// `always`; `None` where there is no edge below.
    fn help(&mut self, helper: Helper, always: bool) -> Option<()> {
        let here = self.edge(helper.corner, helper.corner);
        let (_, below) = self.edges.range_mut(..here).next_back()?;
        if always || below.merges {
            self.diagonals.push([helper.corner, below.corner]);
        }
        *below = helper;
        Some(())
    }

    fn edge(&self, left: u32, right: u32) -> Edge<'a> {
        Edge {
            plane: self.plane,
            left,
            right,
        }
    }
}

impl<'a> Plane<'a> {
    fn new(points: &'a [[f64; 2]]) -> Self {
        let n = points.len();
        let mut order: Vec<u32> = (0..n as u32).collect();
        order.sort_unstable_by(|&a, &b| {
            let [p, q] = [a, b].map(|k| points[k as usize]);
            p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])).then(a.cmp(&b))
        });
        let mut rank = vec![0; n];
        for (place, &k) in order.iter().enumerate() {
            rank[k as usize] = place as u32;
        }
        Self { points, rank, order }
    }

    /// Positive where three corners turn counter-clockwise, 0 where they are on a line.
    fn turn(&self, a: u32, b: u32, c: u32) -> f64 {
        let [a, b, c] = [a, b, c].map(|k| {
            let [x, y] = self.points[k as usize];
            Coord { x, y }
        });
        orient2d(a, b, c)
    }

    /// Diagonals that cut the polygon into monotone pieces; `None` where the sweep meets a crossing.
    fn diagonals(&'a self, cancel: &Cancel) -> Result<Option<Vec<[u32; 2]>>, MeshError> {
        let n = self.points.len() as u32;
        let mut status = Status {
            plane: self,
            edges: BTreeMap::new(),
            diagonals: Vec::new(),
        };
        for (k, &corner) in self.order.iter().enumerate() {
            if k.is_multiple_of(STRIDE) {
                cancel.check()?;
            }
            let next = if corner + 1 == n { 0 } else { corner + 1 };
            let previous = if corner == 0 { n - 1 } else { corner - 1 };
            if self.meet(&mut status, [previous, corner, next]).is_none() {
                return Ok(None);
            }
        }
        Ok(Some(status.diagonals))
    }

    /// What the sweep does at a corner.
    fn meet(&self, status: &mut Status<'_>, [previous, corner, next]: [u32; 3]) -> Option<()> {
        let rank = |k: u32| self.rank[k as usize];
        let helper = |merges| Helper { corner, merges };
        let convex = || self.turn(previous, corner, next) > 0.0;
        match (rank(previous) < rank(corner), rank(next) < rank(corner)) {
            // The border starts here, or splits the interior.
            (false, false) => {
                if !convex() {
                    status.help(helper(false), true)?;
                }
                status.start(corner, next);
            }
            // The border ends here, or merges what is above and below.
            (true, true) => {
                let merges = !convex();
                status.end(previous, corner)?;
                if merges {
                    status.help(helper(true), false)?;
                }
            }
            // The interior is above.
            (true, false) => {
                status.end(previous, corner)?;
                status.start(corner, next);
            }
            // The interior is below.
            (false, true) => status.help(helper(false), false)?,
        }
        Some(())
    }

    /// Whether triangles have the polygon's border, and together its area without turning over.
    fn is_triangulation(&self, triangles: &[[u32; 3]]) -> bool {
        let n = self.points.len() as u32;
        if triangles.len() + 2 != n as usize {
            return false;
        }
        let doubled = |a: u32, b: u32, c: u32| {
            let [a, b, c] = [a, b, c].map(|k| self.points[k as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let whole: f64 = (1..n - 1).map(|k| doubled(0, k, k + 1)).sum();
        let parts: f64 = triangles.iter().map(|&[a, b, c]| doubled(a, b, c).abs()).sum();
        let is_covered = (parts - whole).abs() <= 1e-9 * whole;
        if !is_covered {
            return false;
        }
        // Each edge once in each direction, or once along the border.
        let mut edges: Vec<[u32; 3]> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b), u32::from(a > b)])
            .collect();
        edges.sort_unstable();
        let mut borders = 0;
        let paired = edges.chunk_by(|e, f| e[..2] == f[..2]).all(|edge| match edge {
            [[a, b, backwards]] => {
                borders += 1;
                (a + 1 == *b && *backwards == 0) || (*a == 0 && b + 1 == n && *backwards == 1)
            }
            [[_, _, 0], [_, _, 1]] => true,
            _ => false,
        });
        paired && borders == n
    }
}

/// The polygon cut along diagonals: closed chains of places, where a corner has a place in each of its pieces.
struct Pieces {
    corner: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Another place of the same corner; the places of a corner form a circle.
    twin: Vec<u32>,
}

impl Pieces {
    fn new(n: usize, diagonals: usize) -> Self {
        let places = n + 2 * diagonals;
        let room = |first: fn(u32, u32) -> u32| {
            let mut list = Vec::with_capacity(places);
            list.extend((0..n as u32).map(|k| first(k, n as u32)));
            list
        };
        Self {
            corner: room(|k, _| k),
            next: room(|k, n| (k + 1) % n),
            previous: room(|k, n| (k + n - 1) % n),
            twin: room(|k, _| k),
        }
    }

    /// Cuts the piece that holds the diagonal of two corners in two.
    fn split(&mut self, a: u32, b: u32, plane: &Plane<'_>) {
        let (at, to) = (self.place(a, b, plane), self.place(b, a, plane));
        let (after, before) = (self.next[at as usize], self.previous[to as usize]);
        // at → to keeps its places; before → new `to` → new `at` → after is the other piece.
        let (new_to, new_at) = (self.copy(to), self.copy(at));
        self.link(at, to);
        self.link(new_to, new_at);
        self.link(before, new_to);
        self.link(new_at, after);
    }

    fn link(&mut self, from: u32, to: u32) {
        self.next[from as usize] = to;
        self.previous[to as usize] = from;
    }

    fn copy(&mut self, place: u32) -> u32 {
        let new = self.corner.len() as u32;
        self.corner.push(self.corner[place as usize]);
        self.next.push(new);
        self.previous.push(new);
        self.twin.push(self.twin[place as usize]);
        self.twin[place as usize] = new;
        new
    }

    /// The place of a corner whose piece a diagonal to another corner enters.
    fn place(&self, corner: u32, other: u32, plane: &Plane<'_>) -> u32 {
        let mut place = corner;
        loop {
            let [before, after] = [self.previous[place as usize], self.next[place as usize]];
            let [before, after] = [before, after].map(|k| self.corner[k as usize]);
            let left_of_next = plane.turn(corner, after, other) > 0.0;
            let right_of_previous = plane.turn(corner, other, before) > 0.0;
            let enters = if plane.turn(before, corner, after) > 0.0 {
                left_of_next && right_of_previous
            } else {
                left_of_next || right_of_previous
            };
            if enters {
                return place;
            }
            place = self.twin[place as usize];
            if place == corner {
                // No piece is entered: the outcome is no triangulation, which is found later.
                return corner;
            }
        }
    }

    /// Triangulates every piece; `None` where a piece cannot be one of a polygon.
    fn triangulate(&self, plane: &Plane<'_>, cancel: &Cancel) -> Result<Option<Vec<[u32; 3]>>, MeshError> {
        let expected = plane.points.len() - 2;
        let mut triangles = Vec::with_capacity(expected);
        let mut done = vec![false; self.next.len()];
        let mut piece = Vec::new();
        for start in 0..self.next.len() {
            if start.is_multiple_of(STRIDE) {
                cancel.check()?;
            }
            if done[start] {
                continue;
            }
            piece.clear();
            let mut at = start;
            while !done[at] {
                done[at] = true;
                piece.push(self.corner[at]);
                at = self.next[at] as usize;
            }
            if piece.len() < 3 || triangles.len() + piece.len() - 2 > expected {
                return Ok(None);
            }
            triangulate_monotone(&mut piece, plane, &mut triangles);
        }
        Ok(Some(triangles))
    }
}

/// Which border of a monotone piece a corner is on.
#[derive(Clone, Copy, PartialEq)]
enum Chain {
    Lower,
    Upper,
}

/// Triangulates a piece whose border goes right from its leftmost corner to its rightmost one and back.
fn triangulate_monotone(piece: &mut [u32], plane: &Plane<'_>, triangles: &mut Vec<[u32; 3]>) {
    let rank = |k: &u32| plane.rank[*k as usize];
    let leftmost = (0..piece.len()).min_by_key(|&k| rank(&piece[k])).unwrap_or(0);
    piece.rotate_left(leftmost);
    let rightmost = (0..piece.len()).max_by_key(|&k| rank(&piece[k])).unwrap_or(0);
    let (lower, upper) = piece.split_at(rightmost);
    // Both borders, merged into the order of the sweep.
    let (mut i, mut j) = (0, upper.len());
    let merged = std::iter::from_fn(|| {
        let take_lower = match (lower.get(i), j.checked_sub(1)) {
            (Some(a), Some(b)) => rank(a) < rank(&upper[b]),
            (Some(_), None) => true,
            (None, Some(_)) => false,
            (None, None) => return None,
        };
        if take_lower {
            i += 1;
            return Some((lower[i - 1], Chain::Lower));
        }
        j -= 1;
        Some((upper[j], Chain::Upper))
    });
    let mut stack: Vec<(u32, Chain)> = Vec::new();
    let last = piece.len() - 1;
    for (k, (corner, chain)) in merged.enumerate() {
        let Some(&top) = stack.last().filter(|_| k > 1) else {
            stack.push((corner, chain));
            continue;
        };
        let side = if k == last { opposite(top.1) } else { chain };
        let triangle = |a: u32, b: u32| match side {
            // a is left of b; the corner is on the other border.
            Chain::Upper => [a, b, corner],
            Chain::Lower => [b, a, corner],
        };
        if side != top.1 {
            triangles.extend(stack.windows(2).map(|w| triangle(w[0].0, w[1].0)));
            stack.clear();
            stack.push(top);
        } else {
            while let [.., (a, _), (b, _)] = stack[..] {
                let [p, q, r] = match chain {
                    Chain::Lower => [a, b, corner],
                    Chain::Upper => [b, a, corner],
                };
                if plane.turn(p, q, r) <= 0.0 {
                    break;
                }
                triangles.push([p, q, r]);
                stack.pop();
            }
        }
        stack.push((corner, chain));
    }
}

fn opposite(chain: Chain) -> Chain {
    match chain {
        Chain::Lower => Chain::Upper,
        Chain::Upper => Chain::Lower,
    }
}
