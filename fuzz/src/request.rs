//! What a client says beside a mesh: query strings and JSON bodies. The first byte chooses which one the rest is.

use axum::body::Body;
use axum::extract::{FromRequest, FromRequestParts};
use axum::http::{Request, Uri};
use shapelex::http::dto::PageQuery;
use shapelex::http::dto::class::{CreateClass, RenameClass};
use shapelex::http::dto::job::StartReindex;
use shapelex::http::dto::query::QueryOptions;
use shapelex::http::dto::shape::UploadQuery;
use shapelex::http::extract::{ApiJson, ApiQuery, OptionalJson};
use shapelex::model::{ClassId, ClassName};
use shapelex_core::parameters::Parameters;
use tokio::runtime::{Builder, Runtime};

thread_local! {
    /// Bodies have a time limit, which needs a clock.
    static RUNTIME: Runtime = Builder::new_current_thread()
        .enable_time()
        .build()
        .expect("a runtime without threads or sockets");
}

/// Parses; what is accepted is valid where its type says so.
pub fn check(bytes: &[u8]) {
    let Some((&which, rest)) = bytes.split_first() else {
        return;
    };
    match which % 8 {
        0 => drop(query::<QueryOptions>(rest)),
        1 => drop(query::<UploadQuery>(rest)),
        2 | 3 => page(rest),
        4 => {
            if let Some(ApiJson(body)) = json::<ApiJson<CreateClass>>(rest) {
                let _ = body.name.parse::<ClassName>();
            }
        }
        5 => drop(json::<ApiJson<RenameClass>>(rest)),
        _ => reindex(rest),
    }
}

fn page(bytes: &[u8]) {
    if let Some(page) = query::<PageQuery>(bytes) {
        assert!(page.limit().is_ok_and(|n| (1..=1000).contains(&n)) || page.limit().is_err());
        let _ = page.after::<ClassId>("classes");
        let _ = page.after::<ClassName>("classes");
    }
}

fn reindex(bytes: &[u8]) {
    let Some(OptionalJson(body)) = json::<OptionalJson<StartReindex>>(bytes) else {
        return;
    };
    let base = body
        .preset
        .map_or_else(Parameters::default, |preset| Parameters::preset(preset.into()));
    let parameters = body.parameters.unwrap_or_default().apply(base);
    if parameters.validate().is_ok() {
        // Accepted parameters are stored as JSON and named by their fingerprints.
        let text = serde_json_round_trip(&parameters);
        assert_eq!(
            text.description_fingerprint(),
            parameters.description_fingerprint()
        );
        assert_eq!(text.learning_fingerprint(), parameters.learning_fingerprint());
    }
}

fn serde_json_round_trip(parameters: &Parameters) -> Parameters {
    // Numbers that are not finite would become null here.
    serde_json::from_str(&serde_json::to_string(parameters).expect("plain data")).expect("reads back")
}

fn query<T>(bytes: &[u8]) -> Option<T>
where
    ApiQuery<T>: FromRequestParts<()>,
{
    let uri = Uri::try_from([b"/v1/query?".as_slice(), bytes].concat()).ok()?;
    let (mut parts, ()) = Request::get(uri).body(()).ok()?.into_parts();
    let found = RUNTIME.with(|runtime| {
        runtime.block_on(<ApiQuery<T> as FromRequestParts<()>>::from_request_parts(
            &mut parts,
            &(),
        ))
    });
    found.ok().map(|ApiQuery(value)| value)
}

fn json<T: FromRequest<()>>(bytes: &[u8]) -> Option<T> {
    let request = Request::post("/")
        .header("content-type", "application/json")
        .body(Body::from(bytes.to_vec()))
        .ok()?;
    RUNTIME.with(|runtime| runtime.block_on(T::from_request(request, &())).ok())
}
