//! A batch of queries → lines of JSON, as meshes are finished.

use super::admission::Patience;
use super::dto::query::{BatchLine, BatchSummary, QueryOptions};
use super::metrics;
use super::poses::Poses;
use super::problem::Problem;
use super::run_query::{Rendered, run_query};
use super::state::AppState;
use super::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use axum::body::Body;
use bytes::Bytes;
use futures_util::{Stream, StreamExt, stream};
use shapelex_core::memory::Reservation;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a batch is ranked with.
#[derive(Clone)]
pub(super) struct Batch {
    pub(super) state: AppState,
    pub(super) live: Arc<LiveIndex>,
    pub(super) options: QueryOptions,
    pub(super) poses: Poses,
    /// The request's id, for problems.
    pub(super) id: Option<String>,
}

/// The memory of the lines that the client has not taken yet: the last one, and the one before, of which a part may be
/// left.
#[derive(Default)]
struct Sending(Option<Reservation>, Option<Reservation>);

impl Sending {
    fn hold(&mut self, memory: Reservation) {
        self.0 = self.1.replace(memory);
    }
}

/// A mesh of a batch, or one pose of it, by the mesh's number.
type Numbered<T> = (usize, UploadedMesh, T);

impl Batch {
    /// The answer's body: a line per mesh or pose, and the counts. A batch that a shutdown cuts short has no counts, so
    /// that it is not taken for the whole.
    pub(super) fn body(self, meshes: Vec<UploadedMesh>) -> Body {
        let expected = Arc::new(AtomicUsize::new(meshes.len()));
        let answers = self.clone().answers(meshes, &expected);
        let id = self.id;
        let lines = stream::unfold(
            (
                Box::pin(answers),
                BatchSummary::default(),
                false,
                Sending::default(),
            ),
            move |(mut answers, mut summary, ended, mut sending)| {
                let (id, expected) = (id.clone(), Arc::clone(&expected));
                async move {
                    if ended {
                        return None;
                    }
                    let line = match answers.next().await {
                        Some(answer) => line(answer, &mut summary, &mut sending, id.as_deref()),
                        None if summary.ok + summary.failed < expected.load(Ordering::Relaxed) => {
                            return None;
                        }
                        None => {
                            summary.total = summary.ok + summary.failed;
                            let last = line_of(&BatchLine::Summary { summary });
                            return Some((Ok::<_, Infallible>(last), (answers, summary, true, sending)));
                        }
                    };
                    Some((Ok(line), (answers, summary, false, sending)))
                }
            },
        );
        Body::from_stream(lines)
    }

    /// As many at a time as there are query threads. `expected` becomes the number of answers as files turn out to have
    /// several poses.
    fn answers(
        self,
        meshes: Vec<UploadedMesh>,
        expected: &Arc<AtomicUsize>,
    ) -> impl Stream<Item = Numbered<Result<Rendered, Problem>>> + use<> {
        let threads = self.state.config.query_threads.max(1);
        let stopping = self.state.stopping.clone();
        let (expected, ranking) = (Arc::clone(expected), self.clone());
        stream::iter(meshes.into_iter().enumerate())
            .then(move |(index, mesh)| {
                let (batch, expected) = (self.clone(), Arc::clone(&expected));
                async move {
                    let found = batch.in_poses(mesh).await;
                    expected.fetch_add(found.len() - 1, Ordering::Relaxed);
                    stream::iter(found.into_iter().map(move |(mesh, read)| (index, mesh, read)))
                }
            })
            .flatten()
            .map(move |(index, mesh, read)| {
                let batch = ranking.clone();
                async move {
                    let answer = match read {
                        Ok(()) => {
                            let Batch {
                                state, live, options, ..
                            } = batch;
                            let line = move |answer| {
                                line_of(&BatchLine::Answered {
                                    status: "ok",
                                    index,
                                    answer: Box::new(answer),
                                })
                            };
                            run_query(&state, Patience::Batch, live, mesh.clone(), options, line).await
                        }
                        Err(problem) => Err(problem),
                    };
                    (index, mesh, answer)
                }
            })
            .buffer_unordered(threads)
            .take_until(stopping.cancelled_owned())
    }

    /// A file's mesh once per pose, or once with what keeps its poses from being read. Never empty.
    async fn in_poses(&self, mesh: UploadedMesh) -> Vec<(UploadedMesh, Result<(), Problem>)> {
        let Poses::Each(poses) = self.poses else {
            return vec![match self.poses.only(mesh.clone()) {
                Ok(mesh) => (mesh, Ok(())),
                Err(problem) => (mesh, Err(problem)),
            }];
        };
        let limits = self.state.config.limits;
        let file = mesh.clone();
        let found = self
            .state
            .compute
            .run(Patience::Batch, self.state.config.query_timeout, move |work| {
                file.in_poses(poses, limits, &work.cancel)
            })
            .await;
        match found {
            Ok(found) if !found.is_empty() => found.into_iter().map(|mesh| (mesh, Ok(()))).collect(),
            // A file without any pose is ranked as it is.
            Ok(_) => vec![(mesh, Ok(()))],
            Err(problem) => vec![(mesh, Err(problem))],
        }
    }
}

fn line(
    (index, mesh, answer): Numbered<Result<Rendered, Problem>>,
    summary: &mut BatchSummary,
    sending: &mut Sending,
    id: Option<&str>,
) -> Bytes {
    match answer {
        Ok(rendered) => {
            summary.ok += 1;
            sending.hold(rendered.memory);
            rendered.text
        }
        Err(problem) => {
            summary.failed += 1;
            metrics::count_problem(problem.code);
            if let Some(internal) = &problem.internal {
                let (code, name) = (problem.code.name(), &mesh.name);
                tracing::error!(code, internal, name, "{}", problem.detail);
            }
            line_of(&BatchLine::Failed {
                status: "failed",
                index,
                pose: mesh.pose().cloned().map(Into::into),
                name: mesh.name,
                problem: problem.to_json(id),
            })
        }
    }
}

fn line_of(line: &BatchLine) -> Bytes {
    // Strings, numbers and maps with string keys always serialise.
    let mut text = serde_json::to_vec(line).unwrap_or_default();
    text.push(b'\n');
    text.into()
}
