//! The caller's place in a distributed trace: the header `traceparent` of W3C Trace Context, level 1.

use axum::http::{HeaderMap, StatusCode};

/// Where a request stands in its caller's trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceParent<'a> {
    /// The trace, 32 hexadecimal digits.
    pub trace: &'a str,
    /// The caller's span, 16 hexadecimal digits.
    pub span: &'a str,
    /// Whether the caller keeps the trace.
    pub sampled: bool,
}

/// Reads the header. One that is not as the specification has it counts as none.
pub fn trace_parent(headers: &HeaderMap) -> Option<TraceParent<'_>> {
    let text = headers.get("traceparent")?.to_str().ok()?;
    let mut parts = text.split('-');
    let (version, trace, span, flags) = (parts.next()?, parts.next()?, parts.next()?, parts.next()?);
    let hex = |part: &str, digits: usize| {
        part.len() == digits
            && part
                .bytes()
                .all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
    };
    let some = |part: &str| part.bytes().any(|b| b != b'0');
    // Later versions may add parts at the end; the first has none.
    let known = hex(version, 2) && version != "ff" && (version != "00" || parts.next().is_none());
    (known && hex(trace, 32) && some(trace) && hex(span, 16) && some(span) && hex(flags, 2)).then(|| {
        TraceParent {
            trace,
            span,
            // The lowest bit; the others say nothing yet.
            sampled: u8::from_str_radix(flags, 16).is_ok_and(|flags| flags & 1 == 1),
        }
    })
}

/// Where traces are exported: makes the request's span a child of its caller's, or the root of a trace of its own, and
/// calls it after the operation. Must come before anything happens in the span.
#[cfg(feature = "otlp")]
pub fn begin(span: &tracing::Span, parent: Option<TraceParent<'_>>, operation: &str) {
    use opentelemetry::Context;
    use opentelemetry::trace::{SpanContext, SpanId, TraceContextExt, TraceFlags, TraceId, TraceState};
    use tracing_opentelemetry::OpenTelemetrySpanExt;

    let remote = parent.and_then(|parent| {
        Some(SpanContext::new(
            TraceId::from_hex(parent.trace).ok()?,
            SpanId::from_hex(parent.span).ok()?,
            TraceFlags::default().with_sampled(parent.sampled),
            true,
            TraceState::default(),
        ))
    });
    let under = remote.map_or_else(Context::new, |remote| {
        Context::new().with_remote_span_context(remote)
    });
    // Not an error: no collector is named.
    if span.set_parent(under).is_err() {
        return;
    }
    span.record("otel.name", operation);
    span.record("otel.kind", "server");
    if parent.is_none() {
        let trace = span.context().span().span_context().trace_id();
        span.record("trace_id", tracing::field::display(trace));
    }
}

/// Where traces are exported: says how the request ended.
#[cfg(feature = "otlp")]
pub fn end(span: &tracing::Span, status: StatusCode, outcome: &'static str) {
    use opentelemetry::trace::Status;
    use tracing_opentelemetry::OpenTelemetrySpanExt;

    span.set_attribute("http.response.status_code", i64::from(status.as_u16()));
    if status.is_server_error() {
        span.set_status(Status::error(outcome));
    }
}

/// Without traces there is nothing to place.
#[cfg(not(feature = "otlp"))]
pub fn begin(_: &tracing::Span, _: Option<TraceParent<'_>>, _: &str) {}

/// Without traces there is nothing to end.
#[cfg(not(feature = "otlp"))]
pub fn end(_: &tracing::Span, _: StatusCode, _: &'static str) {}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn parse(text: &'static str) -> Option<(String, String, bool)> {
        let mut headers = HeaderMap::new();
        headers.insert("traceparent", HeaderValue::from_static(text));
        trace_parent(&headers).map(|t| (t.trace.to_owned(), t.span.to_owned(), t.sampled))
    }

    #[test]
    fn only_what_the_specification_allows_is_taken_over() {
        let good = parse("00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01").unwrap();
        assert_eq!(good.0, "4bf92f3577b34da6a3ce929d0e0e4736");
        assert_eq!(good.1, "00f067aa0ba902b7");
        assert!(good.2);
        let unkept = parse("00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-02").unwrap();
        assert!(!unkept.2);
        assert!(parse("01-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-more").is_some());
        for bad in [
            "",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-more",
            "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
            "00-4bf92f-00f067aa0ba902b7-01",
        ] {
            assert_eq!(parse(bad), None, "{bad}");
        }
    }
}
