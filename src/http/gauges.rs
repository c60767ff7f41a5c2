//! The gauges: how the service stands at the moment it is asked.

use super::metrics;
use super::state::AppState;
use crate::store::ScrubReport;
use ::metrics::gauge;

/// Everything, as Prometheus reads it. Gauges are read off the service now.
pub fn render(state: &AppState) -> String {
    let live = state.jobs.live_index();
    gauge!("shapelex_compute_running").set(state.compute.running() as f64);
    gauge!("shapelex_compute_waiting").set(state.compute.waiting() as f64);
    gauge!("shapelex_memory_reserved_bytes").set(state.memory.used() as f64);
    gauge!("shapelex_memory_limit_bytes").set(state.memory.limit() as f64);
    gauge!("shapelex_body_bytes").set(state.memory.bodies() as f64);
    gauge!("shapelex_connections").set(state.connections.len() as f64);
    gauge!("shapelex_api_keys").set(state.keys.len() as f64);
    gauge!("shapelex_jobs_pending").set(state.jobs.queue_depth() as f64);
    gauge!("shapelex_index_generation").set(live.generation.as_ref().map_or(0, |g| g.number) as f64);
    gauge!("shapelex_ready").set(f64::from(u8::from(state.readiness().is_ready())));
    gauge!("shapelex_index_classes").set(live.search.dictionaries.classes.len() as f64);
    if let Ok(statistics) = state.store.statistics() {
        gauge!("shapelex_classes").set(statistics.classes as f64);
        gauge!("shapelex_shapes").set(statistics.shapes as f64);
        gauge!("shapelex_original_bytes").set(statistics.bytes as f64);
    }
    if let Some(free) = state.store.disk_free() {
        gauge!("shapelex_disk_free_bytes").set(free as f64);
    }
    read_integrity(state);
    metrics_process::Collector::default().collect();
    metrics::text()
}

fn read_integrity(state: &AppState) {
    let damage = state.store.damage();
    gauge!("shapelex_damaged_originals").set(damage.originals.len() as f64);
    gauge!("shapelex_damaged_records").set(damage.records.len() as f64);
    let last = state.store.last_scrub();
    let of = |value: fn(&ScrubReport) -> f64| last.as_ref().map_or(0.0, value);
    gauge!("shapelex_scrub_timestamp_seconds").set(of(|last| last.finished_at.as_second() as f64));
    gauge!("shapelex_scrub_originals").set(of(|last| last.originals as f64));
    gauge!("shapelex_scrub_records").set(of(|last| last.records as f64));
}
