//! Watches a process: its resident size every few milliseconds, and how long `/healthz` takes.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What was seen since it was last asked.
pub struct Seen {
    pub peak_mib: u64,
    pub median_ms: f64,
    pub worst_ms: f64,
}

#[derive(Default)]
struct Shared {
    peak_kib: AtomicU64,
    milliseconds: Mutex<Vec<f64>>,
    ended: AtomicBool,
}

pub struct Watch {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// Resident memory of a process, in KiB; 0 where it is gone.
fn resident(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok())
        .unwrap_or(0)
}

/// How long the probe takes; as long as it may where there is no answer.
fn probe(address: &str) -> Duration {
    const LIMIT: Duration = Duration::from_secs(5);
    let began = Instant::now();
    let answered = || -> std::io::Result<bool> {
        let mut stream = TcpStream::connect(address)?;
        stream.set_read_timeout(Some(LIMIT))?;
        stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")?;
        let mut text = String::new();
        stream.read_to_string(&mut text)?;
        Ok(text.starts_with("HTTP/1.1 200"))
    };
    match answered() {
        Ok(true) => began.elapsed(),
        _ => LIMIT,
    }
}

impl Watch {
    pub fn start(pid: u32, address: &str) -> Self {
        let shared = Arc::new(Shared::default());
        let (sizes, times) = (Arc::clone(&shared), Arc::clone(&shared));
        let address = address.to_owned();
        let threads = vec![
            std::thread::spawn(move || {
                while !sizes.ended.load(Ordering::Relaxed) {
                    sizes.peak_kib.fetch_max(resident(pid), Ordering::Relaxed);
                    std::thread::sleep(Duration::from_millis(3));
                }
            }),
            std::thread::spawn(move || {
                while !times.ended.load(Ordering::Relaxed) {
                    let took = probe(&address).as_secs_f64() * 1e3;
                    times.milliseconds.lock().unwrap().push(took);
                    std::thread::sleep(Duration::from_millis(20));
                }
            }),
        ];
        Self { shared, threads }
    }

    /// What was seen since the last call.
    pub fn take(&self) -> Seen {
        let peak = self.shared.peak_kib.swap(0, Ordering::Relaxed);
        let mut times = std::mem::take(&mut *self.shared.milliseconds.lock().unwrap());
        times.sort_by(f64::total_cmp);
        Seen {
            peak_mib: peak >> 10,
            median_ms: times.get(times.len() / 2).copied().unwrap_or(0.0),
            worst_ms: times.last().copied().unwrap_or(0.0),
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}
