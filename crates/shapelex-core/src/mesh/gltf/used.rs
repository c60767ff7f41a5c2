//! Which vertices of an accessor the faces use. An accessor may hold the vertices of a whole library of meshes.

/// A set of vertices below a declared number, and the place of each in it.
pub(super) enum Used {
    /// All of this many.
    All(usize),
    /// Few of many, ascending.
    Few(Vec<u32>),
    /// A bit per declared vertex, and the number of bits set before each word.
    Many {
        bits: Vec<u64>,
        before: Vec<u32>,
        len: usize,
    },
}

/// Indices per declared vertex below which a list is smaller than a bit for every vertex.
const SPARSE: usize = 32;

impl Used {
    /// Bytes that [`of`](Self::of) takes for this many indices.
    pub fn bytes(indices: usize, declared: usize) -> u64 {
        if indices < declared / SPARSE {
            4 * indices as u64
        } else {
            declared as u64 / 8 + declared as u64 / 16 + 16
        }
    }

    /// The vertices that `indices`, all below `declared`, refer to.
    pub fn of<'i>(indices: impl Iterator<Item = &'i u32>, count: usize, declared: usize) -> Self {
        if count < declared / SPARSE {
            let mut list: Vec<u32> = Vec::with_capacity(count);
            list.extend(indices);
            list.sort_unstable();
            list.dedup();
            return Self::Few(list);
        }
        let mut bits = vec![0u64; declared.div_ceil(64)];
        for &k in indices {
            bits[k as usize / 64] |= 1 << (k % 64);
        }
        let mut len = 0;
        let before: Vec<u32> = bits
            .iter()
            .map(|word| {
                let before = len;
                len += word.count_ones();
                before
            })
            .collect();
        let len = len as usize;
        if len == declared {
            return Self::All(declared);
        }
        Self::Many { bits, before, len }
    }

    /// How many vertices are used.
    pub fn len(&self) -> usize {
        match self {
            Self::All(len) | Self::Many { len, .. } => *len,
            Self::Few(list) => list.len(),
        }
    }

    /// How many used vertices come before vertex `k`, which is used.
    pub fn place(&self, k: u32) -> u32 {
        match self {
            Self::All(_) => k,
            Self::Few(list) => list.partition_point(|used| *used < k) as u32,
            Self::Many { bits, before, .. } => {
                let (word, bit) = (k as usize / 64, k % 64);
                before[word] + (bits[word] & ((1 << bit) - 1)).count_ones()
            }
        }
    }

    /// The used vertices, ascending.
    pub fn iter(&self) -> Box<dyn Iterator<Item = usize> + '_> {
        match self {
            Self::All(len) => Box::new(0..*len),
            Self::Few(list) => Box::new(list.iter().map(|k| *k as usize)),
            Self::Many { bits, .. } => Box::new(bits.iter().enumerate().flat_map(|(at, word)| {
                let mut left = *word;
                std::iter::from_fn(move || {
                    let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
                    left &= left - 1;
                    Some(64 * at + bit)
                })
            })),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_gives_the_same_places() {
        let indices = [7u32, 3, 200, 3, 64, 63];
        let expected = [3usize, 7, 63, 64, 200];
        for declared in [201, 5000] {
            let used = Used::of(indices.iter(), indices.len(), declared);
            assert_eq!(matches!(used, Used::Few(_)), declared == 5000);
            assert_eq!(used.iter().collect::<Vec<_>>(), expected);
            assert_eq!(used.len(), expected.len());
            for (place, k) in expected.iter().enumerate() {
                assert_eq!(used.place(*k as u32), place as u32);
            }
        }
        let all = Used::of([2, 0, 1].iter(), 3, 3);
        assert!(matches!(all, Used::All(3)));
        assert_eq!(all.iter().collect::<Vec<_>>(), [0, 1, 2]);
    }
}
