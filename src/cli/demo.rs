//! `shapelex demo`: the whole service on a zoo it makes itself, over HTTP.

use super::client::Client;
use super::demo_report::{Answer, Summary};
use super::files::MeshFile;
use super::output::note_line;
use super::progress::Progress;
use super::zoo::{Specimen, ZooFormat, specimens, write};
use super::{CliError, ParameterArgs, api, ask, data_dir, output, service};
use crate::config::Config;
use crate::http::ServiceConfig;
use rayon::prelude::*;
use serde_json::json;
use shapelex_eval::sample::ZooOptions;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::sync::oneshot;

/// Requests under way at the same time.
const CONNECTIONS: usize = 4;
/// How long the service may take to start.
const START_WITHIN: Duration = Duration::from_secs(60);

/// Arguments of `demo`.
#[derive(Debug, clap::Args)]
pub struct DemoArgs {
    /// Kinds of creatures
    #[arg(long, value_name = "COUNT", default_value_t = 16)]
    pub classes: usize,
    /// Poses of each; two thirds train, the others are queried
    #[arg(long, value_name = "COUNT", default_value_t = 12)]
    pub poses: usize,
    /// Seed of the zoo
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Leave the service up afterwards, until Ctrl-C
    #[arg(long)]
    pub keep: bool,
    /// Data directory, which stays [default: a temporary one]
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Address to listen on; port 0 takes a free one
    #[arg(long, value_name = "ADDRESS", default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, 0)))]
    pub listen: SocketAddr,
    /// The method's parameters.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}

/// Makes a zoo, teaches it to a service and asks about poses it has not seen. With `--json` the last line of stdout is
/// one JSON object.
///
/// # Errors
/// [`CliError::Usage`] for fewer than two classes or poses; [`CliError::Failed`] where a step fails.
pub fn run(args: &DemoArgs, json: bool) -> Result<(), CliError> {
    if args.classes < 2 || args.poses < 2 {
        return Err(CliError::Usage(
            "--classes and --poses must be 2 or more".to_owned(),
        ));
    }
    args.parameters.parameters()?;
    let began = Instant::now();
    let specimens = specimens(
        args.classes,
        args.poses,
        args.seed,
        ZooFormat::Obj,
        &ZooOptions::default(),
    )?;
    let made = began.elapsed().as_secs_f64();
    let training = training_poses(args.poses);
    let (known, unseen): (Vec<Specimen>, Vec<Specimen>) =
        specimens.into_iter().partition(|s| s.pose < training);

    let (data, _temporary) = data_directory(args)?;
    let service = Running::start(config(&data, args.listen))?;
    let url = service.url();
    note_line!("service on {url}");
    let client = Client::remote(&url, None)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(CONNECTIONS)
        .build()
        .map_err(|error| CliError::Failed(format!("no threads: {error}")))?;

    let at = Instant::now();
    pool.install(|| upload(&client, &known))?;
    let uploaded = at.elapsed().as_secs_f64();
    let at = Instant::now();
    api::reindex(&client, &args.parameters, json!("stale"))?;
    let reindexed = at.elapsed().as_secs_f64();
    let at = Instant::now();
    let answers = pool.install(|| query(&client, &unseen))?;
    let queried = at.elapsed().as_secs_f64();

    let summary = Summary::new(
        &answers,
        (args.classes, args.poses, training),
        [made, uploaded, reindexed, queried],
        began.elapsed().as_secs_f64(),
        url.clone(),
    );
    if json {
        output::json(&summary)?;
    } else {
        output::line(&summary.text(&answers))?;
    }
    if args.keep {
        let folder = data.join("demo-queries");
        for specimen in &unseen {
            write(&folder, specimen)?;
        }
        print_commands(&url, &folder, &unseen);
        service.wait()
    } else {
        service.stop()
    }
}

/// The data directory, and what removes it in the end where it is a temporary one.
fn data_directory(args: &DemoArgs) -> Result<(PathBuf, Option<TempDir>), CliError> {
    let Some(data) = &args.data else {
        let temporary = tempfile::Builder::new().prefix("shapelex-demo-").tempdir()?;
        return Ok((temporary.path().to_owned(), Some(temporary)));
    };
    data_dir::require_place(data)?;
    if !data_dir::exists(data) {
        data_dir::say_made(data);
    }
    Ok((data.clone(), None))
}

/// Two thirds of the poses train, at least one, and at least one is left to be queried.
fn training_poses(poses: usize) -> usize {
    (poses * 2 / 3).clamp(1, poses - 1)
}

fn config(data: &Path, listen: SocketAddr) -> ServiceConfig {
    let config = Config {
        data: data.to_owned(),
        listen,
        ..Config::default()
    };
    let mut service = config.service();
    // Nobody queries while the demo learns, so every core may.
    service.indexing_threads = service.query_threads;
    service
}

fn file(specimen: &Specimen) -> MeshFile {
    MeshFile {
        name: specimen.name.clone(),
        bytes: specimen.bytes.clone(),
        companions: Vec::new(),
    }
}

fn upload(client: &Client, specimens: &[Specimen]) -> Result<(), CliError> {
    let progress = Progress::new("upload", specimens.len());
    specimens.par_iter().try_for_each(|specimen| {
        api::upload(client, &specimen.class, file(specimen), None)
            .map_err(|error| CliError::Failed(format!("{}: {error}", specimen.name)))?;
        progress.tick();
        Ok::<(), CliError>(())
    })?;
    progress.finish();
    Ok(())
}

fn query(client: &Client, specimens: &[Specimen]) -> Result<Vec<Answer>, CliError> {
    let progress = Progress::new("query", specimens.len());
    let answers = specimens
        .par_iter()
        .map(|specimen| {
            let value = ask::query(client, file(specimen))
                .map_err(|error| CliError::Failed(format!("{}: {error}", specimen.name)))?;
            progress.tick();
            Ok(Answer::new(&specimen.class, &specimen.name, value))
        })
        .collect::<Result<Vec<_>, CliError>>()?;
    progress.finish();
    Ok(answers)
}

/// What to try next, on stderr: stdout's last line is the answer.
fn print_commands(url: &str, folder: &Path, unseen: &[Specimen]) {
    let example = unseen
        .first()
        .map_or_else(|| folder.to_owned(), |s| folder.join(&s.class).join(&s.name));
    note_line!(
        "\nThe service stays up until Ctrl-C. Poses it has not seen are in {}",
        folder.display()
    );
    note_line!("Try:");
    note_line!(
        "  curl --data-binary @{} '{url}/v1/query?top=3'",
        example.display()
    );
    note_line!("  curl {url}/v1/classes");
    note_line!("  curl {url}/v1/index");
    note_line!("  open {url}/docs");
}

/// The service on a thread of its own.
struct Running {
    address: SocketAddr,
    stop: oneshot::Sender<()>,
    thread: JoinHandle<Result<(), CliError>>,
}

impl Running {
    fn start(config: ServiceConfig) -> Result<Self, CliError> {
        let (stop, stopped) = oneshot::channel();
        let (tell, told) = mpsc::channel();
        let shutdown = async move {
            tokio::select! {
                // A dropped sender means that the demo waits for the person at the keyboard.
                _ = stopped => {}
                () = service::interrupted() => {}
            }
        };
        let thread = std::thread::Builder::new()
            .name("service".to_owned())
            .spawn(move || {
                service::run_until(config, shutdown, |address| {
                    // The other end only goes away with the whole demo.
                    let _ = tell.send(address);
                    Ok(())
                })
            })?;
        match told.recv_timeout(START_WITHIN) {
            Ok(address) => Ok(Self {
                address,
                stop,
                thread,
            }),
            Err(_) if thread.is_finished() => Err(match thread.join() {
                Ok(Err(error)) => error,
                _ => CliError::Failed("the service ended as it started".to_owned()),
            }),
            Err(_) => Err(CliError::Failed(
                "the service did not start within a minute".to_owned(),
            )),
        }
    }

    fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    fn stop(self) -> Result<(), CliError> {
        // A service that has ended by itself says why when it is joined.
        let _ = self.stop.send(());
        join(self.thread)
    }

    /// Waits for Ctrl-C.
    fn wait(self) -> Result<(), CliError> {
        let _stop = self.stop;
        join(self.thread)
    }
}

fn join(thread: JoinHandle<Result<(), CliError>>) -> Result<(), CliError> {
    thread
        .join()
        .map_err(|_| CliError::Failed("the service panicked".to_owned()))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_poses_train_and_some_are_left() {
        assert_eq!(training_poses(12), 8);
        assert_eq!(training_poses(2), 1);
        assert_eq!(training_poses(3), 2);
    }
}
