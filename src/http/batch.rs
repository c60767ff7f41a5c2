//! A batch of queries → lines of JSON, as meshes are finished.

use super::admission::Patience;
use super::dto::query::{BatchLine, BatchSummary, QueryAnswer, QueryOptions};
use super::metrics;
use super::poses::Poses;
use super::problem::Problem;
use super::run_query::run_query;
use super::state::AppState;
use super::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use axum::body::Body;
use bytes::Bytes;
use futures_util::{Stream, StreamExt, stream};
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
            (Box::pin(answers), BatchSummary::default(), false),
            move |(mut answers, mut summary, ended)| {
                let (id, expected) = (id.clone(), Arc::clone(&expected));
                async move {
                    if ended {
                        return None;
                    }
                    let line = match answers.next().await {
                        Some(answer) => line(answer, &mut summary, id.as_deref()),
                        None if summary.ok + summary.failed < expected.load(Ordering::Relaxed) => {
                            return None;
                        }
                        None => {
                            summary.total = summary.ok + summary.failed;
                            return Some((
                                line_of(&BatchLine::Summary { summary }),
                                (answers, summary, true),
                            ));
                        }
                    };
                    Some((line_of(&line), (answers, summary, false)))
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
    ) -> impl Stream<Item = Numbered<Result<QueryAnswer, Problem>>> + use<> {
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
                            run_query(&state, Patience::Batch, live, mesh.clone(), options).await
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
    (index, mesh, answer): Numbered<Result<QueryAnswer, Problem>>,
    summary: &mut BatchSummary,
    id: Option<&str>,
) -> BatchLine {
    match answer {
        Ok(answer) => {
            summary.ok += 1;
            BatchLine::Answered {
                status: "ok",
                index,
                answer: Box::new(answer),
            }
        }
        Err(problem) => {
            summary.failed += 1;
            metrics::count_problem(problem.code);
            if let Some(internal) = &problem.internal {
                let (code, name) = (problem.code.name(), &mesh.name);
                tracing::error!(code, internal, name, "{}", problem.detail);
            }
            BatchLine::Failed {
                status: "failed",
                index,
                pose: mesh.pose().cloned().map(Into::into),
                name: mesh.name,
                problem: problem.to_json(id),
            }
        }
    }
}

fn line_of(line: &BatchLine) -> Result<Bytes, Infallible> {
    // Strings, numbers and maps with string keys always serialise.
    let mut text = serde_json::to_vec(line).unwrap_or_default();
    text.push(b'\n');
    Ok(text.into())
}
