//! A reindex's share of the memory, and how many of its tasks run side by side in it.
//!
//! The share is divided before work begins, by what each task may take at most: a task that waited for memory in the
//! middle of its work could wait for another one that the same thread has begun.

use crate::model::Generation;
use rayon::prelude::*;
use shapelex_core::memory::{MemoryBudget, MemoryError};
use std::cmp::Reverse;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes, and the threads that share them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Share {
    pub(super) bytes: u64,
    pub(super) threads: usize,
}

/// Tasks that run at most so many side by side, each within so many bytes.
#[derive(Debug, PartialEq, Eq)]
struct Round {
    tasks: Vec<usize>,
    parallel: usize,
    each: u64,
}

impl Share {
    /// The share without what an index in memory takes of it.
    pub(super) fn beside(self, taken: u64) -> Self {
        Self {
            bytes: self.bytes.saturating_sub(taken),
            ..self
        }
    }

    /// The same bytes for one task at a time.
    pub(super) fn alone(self) -> Self {
        Self { threads: 1, ..self }
    }

    /// Runs tasks on the current rayon pool, as many side by side as fit by their estimates, the largest first. Each gets
    /// a budget of its own. The results are in the tasks' order; that of a task which never fits says so.
    pub(super) fn run<T: Send>(
        self,
        estimates: &[u64],
        task: impl Fn(usize, &MemoryBudget) -> T + Sync,
    ) -> Vec<Result<T, MemoryError>> {
        let mut done: Vec<(usize, T)> = Vec::with_capacity(estimates.len());
        for round in self.rounds(estimates) {
            let next = AtomicUsize::new(0);
            let strand = |_| {
                let budget = MemoryBudget::new(round.each);
                let mut done = Vec::new();
                while let Some(&i) = round.tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    done.push((i, task(i, &budget)));
                }
                done
            };
            let strands: Vec<_> = (0..round.parallel)
                .into_par_iter()
                .with_max_len(1)
                .map(strand)
                .collect();
            done.extend(strands.into_iter().flatten());
        }
        let mut results: Vec<Result<T, MemoryError>> = estimates
            .iter()
            .map(|&needed| {
                Err(MemoryError::NeverFits {
                    needed,
                    limit: self.bytes,
                })
            })
            .collect();
        for (i, result) in done {
            results[i] = Ok(result);
        }
        results
    }

    fn rounds(self, estimates: &[u64]) -> Vec<Round> {
        let mut order: Vec<usize> = (0..estimates.len()).collect();
        order.sort_by_key(|&i| Reverse(estimates[i]));
        let mut rounds: Vec<Round> = Vec::new();
        for i in order {
            let fit = self.bytes / estimates[i].max(1);
            let parallel = usize::try_from(fit)
                .unwrap_or(usize::MAX)
                .min(self.threads.max(1));
            if parallel == 0 {
                continue;
            }
            match rounds.last_mut() {
                Some(round) if round.parallel == parallel => round.tasks.push(i),
                _ => rounds.push(Round {
                    tasks: vec![i],
                    parallel,
                    each: self.bytes / parallel as u64,
                }),
            }
        }
        rounds
    }
}

/// Memory of a generation's dictionaries once they are loaded, in bytes: their atoms at both precisions, which are three
/// times as long as stored, and both matrices of products of the atoms of each.
pub(super) fn index_bytes(generation: &Generation) -> u64 {
    let classes = generation.classes.iter().map(|class| {
        let products = class.report.channels.values().map(|learnt| {
            let atoms = learnt.atoms as u64;
            12 * atoms * atoms
        });
        // A shape has no more distinct signatures than its class, and so no more atoms.
        let dictionaries = 1 + class.shape_dictionaries.len() as u64;
        3 * class.bytes + dictionaries * products.sum::<u64>()
    });
    classes.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    const SHARE: Share = Share {
        bytes: 100,
        threads: 4,
    };

    #[test]
    fn large_tasks_run_alone_and_small_ones_side_by_side() {
        let rounds = SHARE.rounds(&[10, 60, 101, 30, 20, 0]);
        let told: Vec<_> = rounds
            .iter()
            .map(|r| (r.tasks.clone(), r.parallel, r.each))
            .collect();
        assert_eq!(
            told,
            [(vec![1], 1, 100), (vec![3], 3, 33), (vec![4, 0, 5], 4, 25)]
        );
        assert!(SHARE.beside(200).rounds(&[1]).is_empty());
    }

    #[test]
    fn results_are_in_order_and_name_what_never_fits() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let running = AtomicUsize::new(0);
        let results = pool.install(|| {
            SHARE.run(&[40, 200, 40, 40, 40, 40], |i, budget| {
                assert!(running.fetch_add(1, Ordering::SeqCst) < 2, "two of 40 fit");
                std::thread::sleep(std::time::Duration::from_millis(5));
                running.fetch_sub(1, Ordering::SeqCst);
                assert_eq!(budget.limit(), 50);
                i
            })
        });
        let never = MemoryError::NeverFits {
            needed: 200,
            limit: 100,
        };
        let expected: Vec<Result<usize, MemoryError>> =
            (0..6).map(|i| if i == 1 { Err(never) } else { Ok(i) }).collect();
        assert_eq!(results, expected);
        assert_eq!(SHARE.alone().rounds(&[5, 5, 5])[0].parallel, 1);
        let all: BTreeSet<usize> = (0..3).collect();
        let rounds = SHARE.rounds(&[1, 1, 1]);
        assert_eq!(rounds[0].tasks.iter().copied().collect::<BTreeSet<_>>(), all);
    }
}
