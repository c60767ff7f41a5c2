//! API keys: made, listed, revoked.

use super::classes::insert;
use crate::http::AppState;
use crate::http::access::Access;
use crate::http::caller::Caller;
use crate::http::dto::key::{CreateKey, CreatedKey, KeyDto};
use crate::http::dto::{Page, PageQuery};
use crate::http::extract::{ApiJson, ApiPath, ApiQuery};
use crate::http::keyring::new_secret;
use crate::http::problem::{Code, Problem};
use crate::http::problem_sets::{JSON, PAGE, WRITE};
use crate::http::route::Route;
use crate::http::state::Parts;
use crate::model::key::SECRET_PREFIX;
use crate::model::{ApiKey, KeyHash, KeyId, KeyName, Scope};
use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(
            routes!(create_key),
            Access::Owner,
            &[JSON, WRITE, &[InvalidName, KeyExists, TooManyKeys]],
        ),
        Route::new(routes!(list_keys), Access::Owner, &[PAGE]),
        Route::new(
            routes!(revoke_key),
            Access::Owner,
            &[WRITE, &[InvalidRequest, KeyNotFound, LastAdminKey]],
        ),
    ]
}

/// Make an API key
///
/// The answer has the secret, which is kept nowhere and never shown again. The first key turns keys on: from then on
/// every request needs one, so the first one has to be of scope `admin`. While there is none, keys and restoring need
/// the token that the service keeps in its data directory; `shapelex keys create` sends it by itself.
#[utoipa::path(
    post, path = "/v1/keys", tag = "keys",
    request_body = CreateKey,
    responses((status = 201, description = "The key and its secret", body = CreatedKey, headers(
        ("location" = String, description = "Where the key is"),
    )))
)]
pub async fn create_key(
    State(state): State<AppState>,
    caller: Caller,
    ApiJson(body): ApiJson<CreateKey>,
) -> Result<Response, Problem> {
    let now = Timestamp::now();
    let name = KeyName::new(&body.name)?;
    let scope = Scope::from(body.scope);
    let (limits, expires_at) = (body.limits()?, body.expires_at(now)?);
    let anonymous = caller.key.is_none() && state.config.check_keys;
    let (secret, key) = state
        .blocking(move |s| {
            let _alone = s.catalogue.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if anonymous && (scope != Scope::Admin || expires_at.is_some()) && !has_admin(s)? {
                return Err(Problem::new(
                    Code::InvalidField,
                    "the first key must have scope 'admin' and no end: with it keys are on, and nobody else could make more",
                )
                .with("name", "scope"));
            }
            let secret = new_secret(SECRET_PREFIX).map_err(Problem::internal)?;
            let key = ApiKey {
                id: KeyId::new(),
                name,
                scope,
                hash: KeyHash::of(&secret),
                limits,
                created_at: now,
                expires_at,
            };
            s.store.create_key(key.clone())?;
            s.keys.replace(s.store.api_keys()?);
            Ok((secret, key))
        })
        .await?;
    let location = format!("/v1/keys/{}", key.id);
    let body = CreatedKey {
        secret,
        key: KeyDto::new(&key, now),
    };
    let mut response = (StatusCode::CREATED, Json(body)).into_response();
    insert(&mut response, header::LOCATION, &location);
    insert(&mut response, header::CACHE_CONTROL, "no-store");
    Ok(response)
}

/// List API keys
///
/// In the order they were made, without their secrets.
#[utoipa::path(
    get, path = "/v1/keys", tag = "keys", params(PageQuery),
    responses((status = 200, description = "A page of keys", body = Page<KeyDto>))
)]
pub async fn list_keys(
    State(state): State<AppState>,
    ApiQuery(page): ApiQuery<PageQuery>,
) -> Result<Json<Page<KeyDto>>, Problem> {
    let (limit, after) = (page.limit()?, page.after::<KeyId>("keys")?);
    let mut found = state.blocking(|s| Ok(s.store.api_keys()?)).await?;
    found.retain(|key| after.is_none_or(|after| key.id > after));
    let now = Timestamp::now();
    Ok(Json(Page::cut(
        "keys",
        found,
        limit,
        |key| key.id.to_string(),
        |key| KeyDto::new(&key, now),
    )))
}

/// Revoke an API key
///
/// It stops working at once and for good. The last `admin` key stays while there are others: without it nobody could
/// revoke those.
#[utoipa::path(
    delete, path = "/v1/keys/{key}", tag = "keys",
    params(("key" = String, Path, description = "Its id or its name", example = "scanner")),
    responses((status = 204, description = "It is gone"))
)]
pub async fn revoke_key(
    State(state): State<AppState>,
    ApiPath(wanted): ApiPath<String>,
) -> Result<StatusCode, Problem> {
    state
        .blocking(move |s| {
            let _alone = s
                .catalogue
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            let keys = s.store.api_keys()?;
            let key = keys
                .iter()
                .find(|key| key.id.to_string() == wanted)
                .or_else(|| keys.iter().find(|key| key.name.as_str() == wanted))
                .ok_or_else(|| {
                    let shown: String = wanted.chars().take(100).collect();
                    Problem::new(Code::KeyNotFound, format!("there is no API key '{shown}'"))
                        .with("key", shown)
                })?;
            let now = Timestamp::now();
            let works = |k: &&ApiKey| k.scope == Scope::Admin && !k.is_expired(now);
            let last = works(&key) && keys.iter().filter(works).count() == 1;
            if s.config.check_keys && last && keys.len() > 1 {
                return Err(Problem::new(
                    Code::LastAdminKey,
                    "this is the last key of scope 'admin'; make another one first, or revoke the others",
                ));
            }
            s.store.revoke_key(key.id)?;
            s.keys.replace(s.store.api_keys()?);
            Ok(StatusCode::NO_CONTENT)
        })
        .await
}

fn has_admin(parts: &Parts) -> Result<bool, Problem> {
    let now = Timestamp::now();
    let keys = parts.store.api_keys()?;
    Ok(keys
        .iter()
        .any(|key| key.scope == Scope::Admin && !key.is_expired(now)))
}
