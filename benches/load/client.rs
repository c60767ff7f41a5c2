//! One client: queries one after another, or one query that it leaves.

use crate::service::Service;
use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// One query as its client saw it.
pub struct Sample {
    /// HTTP status; 0 where there was no answer.
    pub status: u16,
    /// From the first byte sent to the last received.
    pub milliseconds: f64,
}

/// Sends queries until then, over one connection, and waits as long as a refusal says, at most a second.
pub fn ask(service: &Service, client: usize, until: Instant) -> Vec<Sample> {
    let agent = service.agent();
    let mut samples = Vec::new();
    let mut turn = client;
    while Instant::now() < until {
        let body = &service.queries[turn % service.queries.len()];
        turn += 1;
        let began = Instant::now();
        let answer = agent
            .post(service.url("/v1/query?top=3"))
            .content_type("model/obj")
            .send(body.as_slice());
        let (status, wait) = match answer {
            Ok(mut response) => {
                let wait = response
                    .headers()
                    .get("retry-after")
                    .and_then(|v| v.to_str().ok()?.parse().ok())
                    .unwrap_or(0.0f64);
                // The answer counts when it is there to its end.
                let read = response.body_mut().read_to_vec();
                (
                    if read.is_ok() {
                        response.status().as_u16()
                    } else {
                        0
                    },
                    wait,
                )
            }
            Err(_) => (0, 0.0),
        };
        samples.push(Sample {
            status,
            milliseconds: began.elapsed().as_secs_f64() * 1e3,
        });
        if status != 200 {
            std::thread::sleep(Duration::from_secs_f64(wait.clamp(0.01, 1.0)));
        }
    }
    samples
}

/// The time a query with this mesh computes, alone.
pub fn time_to_answer(service: &Service, mesh: &[u8]) -> Duration {
    let answer = service
        .agent()
        .post(service.url("/v1/query"))
        .content_type("model/obj")
        .send(mesh);
    let text = answer
        .and_then(|mut answer| answer.body_mut().read_to_string())
        .unwrap_or_default();
    let answer: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    Duration::from_secs_f64(answer["timings_ms"]["total"].as_f64().expect("an answer") / 1e3)
}

/// Sends a query, leaves it so long after its work has begun, and returns the milliseconds until no work of it is done
/// any more. `None` where it was done before.
pub fn time_to_stop(service: &Service, mesh: &[u8], after: Duration) -> Option<f64> {
    let mut stream = TcpStream::connect(service.address()).expect("a connection");
    let head = format!(
        "POST /v1/query HTTP/1.1\r\nhost: {}\r\ncontent-type: model/obj\r\ncontent-length: {}\r\n\r\n",
        service.address(),
        mesh.len()
    );
    stream.write_all(head.as_bytes()).expect("sent");
    stream.write_all(mesh).expect("sent");
    let sent = Instant::now();
    while service.gauge("shapelex_compute_running") < 1.0 && sent.elapsed() < Duration::from_secs(5) {}
    std::thread::sleep(after);
    if service.gauge("shapelex_compute_running") < 1.0 {
        return None;
    }
    drop(stream);
    let left = Instant::now();
    while service.gauge("shapelex_compute_running") > 0.0 && left.elapsed() < Duration::from_secs(60) {}
    Some(left.elapsed().as_secs_f64() * 1e3)
}

/// A share's quantile by the nearest rank; NaN of nothing.
pub fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}
