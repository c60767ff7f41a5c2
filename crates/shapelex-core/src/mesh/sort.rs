//! Sorting with looks at the stop flag.

use super::work::Watch;

/// Elements that are sorted between two looks.
const RUN: usize = 1 << 16;

/// Sorts ascending: runs of 65 536 elements, which are merged two by two. A longer list takes as much memory again.
///
/// # Errors
/// Those of the watch.
pub(super) fn sort<T: Ord + Copy, W: Watch>(list: &mut [T], watch: &W) -> Result<(), W::Error> {
    for run in list.chunks_mut(RUN) {
        watch.look(0)?;
        run.sort_unstable();
    }
    if list.len() <= RUN {
        return Ok(());
    }
    let _held = watch.hold(list.len(), size_of::<T>())?;
    let mut other = list.to_vec();
    let mut width = RUN;
    let (mut from, mut to) = (list, other.as_mut_slice());
    let mut swapped = false;
    while width < from.len() {
        for (pair, merged) in from.chunks(2 * width).zip(to.chunks_mut(2 * width)) {
            let (left, right) = pair.split_at(width.min(pair.len()));
            merge(left, right, merged, watch)?;
        }
        (from, to) = (to, from);
        swapped = !swapped;
        width *= 2;
    }
    if swapped {
        to.copy_from_slice(from);
    }
    Ok(())
}

fn merge<T: Ord + Copy, W: Watch>(
    left: &[T],
    right: &[T],
    merged: &mut [T],
    watch: &W,
) -> Result<(), W::Error> {
    let (mut l, mut r) = (left.iter().peekable(), right.iter().peekable());
    for (i, slot) in merged.iter_mut().enumerate() {
        watch.look(i)?;
        let next = match (l.peek(), r.peek()) {
            (Some(x), Some(y)) if y < x => r.next(),
            (Some(_), _) => l.next(),
            (None, _) => r.next(),
        };
        if let Some(next) = next {
            *slot = *next;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::work::Unwatched;
    use super::*;

    #[test]
    fn runs_of_any_length_are_merged() {
        for n in [0, 1, RUN, RUN + 1, 3 * RUN, 5 * RUN + 17, 9 * RUN] {
            let mut list: Vec<u64> = (0..n as u64)
                .map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20)
                .collect();
            let mut expected = list.clone();
            expected.sort_unstable();
            let Ok(()) = sort(&mut list, &Unwatched);
            assert_eq!(list, expected, "{n}");
        }
    }
}
