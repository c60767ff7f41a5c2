//! Classes: made, listed, shown, renamed, deleted.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::caller::Caller;
use crate::http::dto::class::{ClassDto, CreateClass, RenameClass};
use crate::http::dto::{Page, PageQuery};
use crate::http::extract::{ApiJson, ApiPath, ApiQuery};
use crate::http::problem::{Code, Problem};
use crate::http::problem_sets::{JSON, PAGE, WRITE};
use crate::http::route::Route;
use crate::model::Scope;
use crate::model::{Class, ClassId, ClassName};
use crate::store::{Store, StoreError};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::PoisonError;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(routes!(list_classes), Access::Needs(Scope::Read), &[PAGE]),
        Route::new(
            routes!(create_class),
            Access::Needs(Scope::Write),
            &[JSON, WRITE, &[InvalidName, ClassExists, QuotaExceeded]],
        ),
        Route::new(
            routes!(get_class),
            Access::Needs(Scope::Read),
            &[&[InvalidRequest, ClassNotFound]],
        ),
        Route::new(
            routes!(rename_class),
            Access::Needs(Scope::Write),
            &[
                JSON,
                WRITE,
                &[
                    InvalidRequest,
                    InvalidName,
                    ClassNotFound,
                    ClassExists,
                    RevisionMismatch,
                ],
            ],
        ),
        Route::new(
            routes!(delete_class),
            Access::Needs(Scope::Write),
            &[WRITE, &[InvalidRequest, ClassNotFound, RevisionMismatch]],
        ),
    ]
}

/// Make a class
///
/// Its name must not be taken. Shapes can be uploaded to it at once; queries find it after a reindex.
#[utoipa::path(
    post, path = "/v1/classes", tag = "classes",
    request_body = CreateClass,
    responses((status = 201, description = "The class", body = ClassDto, headers(
        ("location" = String, description = "Where the class is"),
        ("etag" = String, description = "For `if-match`"),
    )))
)]
pub async fn create_class(
    State(state): State<AppState>,
    caller: Caller,
    ApiJson(body): ApiJson<CreateClass>,
) -> Result<Response, Problem> {
    let name = ClassName::new(&body.name)?;
    let class = state
        .blocking(move |s| {
            let maker = s.limits.maker(&caller);
            Ok(s.store.create_class_by(maker.as_ref(), name)?)
        })
        .await?;
    let location = format!("/v1/classes/{}", class.id);
    let mut response = answer(&state, StatusCode::CREATED, class);
    insert(&mut response, header::LOCATION, &location);
    Ok(response)
}

/// List classes
///
/// In the order they were made.
#[utoipa::path(
    get, path = "/v1/classes", tag = "classes", params(PageQuery),
    responses((status = 200, description = "A page of classes", body = Page<ClassDto>))
)]
pub async fn list_classes(
    State(state): State<AppState>,
    ApiQuery(page): ApiQuery<PageQuery>,
) -> Result<Json<Page<ClassDto>>, Problem> {
    let (limit, after) = (page.limit()?, page.after::<ClassId>("classes")?);
    let found = state
        .blocking(move |s| Ok(s.store.list_classes(after, limit + 1)?))
        .await?;
    let live = state.jobs.live_index();
    Ok(Json(Page::cut(
        "classes",
        found,
        limit,
        |class| class.id.to_string(),
        |class| ClassDto::new(class, live.generation.as_ref()),
    )))
}

/// Show a class
#[utoipa::path(
    get, path = "/v1/classes/{class}", tag = "classes",
    params(
        ("class" = String, Path, description = "Its id or its name", example = "dog"),
        ("if-none-match" = Option<String>, Header, description = "The `etag` of the copy at hand"),
    ),
    responses(
        (status = 200, description = "The class", body = ClassDto, headers(
            ("etag" = String, description = "For `if-match` and `if-none-match`"),
        )),
        (status = 304, description = "The copy at hand is as it is"),
    )
)]
pub async fn get_class(
    State(state): State<AppState>,
    ApiPath(class): ApiPath<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let class = state.blocking(move |s| find_class(&s.store, &class)).await?;
    let answer = answer(&state, StatusCode::OK, class);
    let tag = answer
        .headers()
        .get(header::ETAG)
        .and_then(|tag| tag.to_str().ok());
    if !tag.is_some_and(|tag| is_at_hand(&headers, tag)) {
        return Ok(answer);
    }
    let mut unchanged = StatusCode::NOT_MODIFIED.into_response();
    insert(&mut unchanged, header::ETAG, tag.unwrap_or_default());
    Ok(unchanged)
}

/// Rename a class
///
/// Its id, its shapes and its dictionary stay; queries answer with the new name at once.
#[utoipa::path(
    patch, path = "/v1/classes/{class}", tag = "classes",
    params(
        ("class" = String, Path, description = "Its id or its name", example = "dog"),
        ("if-match" = Option<String>, Header, description = "Only where the class still has this `etag`"),
    ),
    request_body = RenameClass,
    responses((status = 200, description = "The class", body = ClassDto, headers(
        ("etag" = String, description = "For `if-match`"),
    )))
)]
pub async fn rename_class(
    State(state): State<AppState>,
    ApiPath(class): ApiPath<String>,
    headers: HeaderMap,
    ApiJson(body): ApiJson<RenameClass>,
) -> Result<Response, Problem> {
    let name = ClassName::new(&body.name)?;
    let class = state
        .blocking(move |s| {
            let _alone = s.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
            let class = find_class(&s.store, &class)?;
            check_match(&headers, &class)?;
            let renamed = s.store.rename_class(class.id, name)?;
            s.jobs.follow_catalogue()?;
            Ok(renamed)
        })
        .await?;
    Ok(answer(&state, StatusCode::OK, class))
}

/// Delete a class
///
/// With its shapes and their files. Queries do not find it any more at once.
#[utoipa::path(
    delete, path = "/v1/classes/{class}", tag = "classes",
    params(
        ("class" = String, Path, description = "Its id or its name", example = "dog"),
        ("if-match" = Option<String>, Header, description = "Only where the class still has this `etag`"),
    ),
    responses((status = 204, description = "It is gone"))
)]
pub async fn delete_class(
    State(state): State<AppState>,
    ApiPath(class): ApiPath<String>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    state
        .blocking(move |s| {
            let _alone = s.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
            let class = find_class(&s.store, &class)?;
            check_match(&headers, &class)?;
            s.store.delete_class(class.id)?;
            s.jobs.follow_catalogue()?;
            Ok(StatusCode::NO_CONTENT)
        })
        .await
}

/// The class of this id or, where there is none, of this name.
pub(super) fn find_class(store: &Store, text: &str) -> Result<Class, Problem> {
    if let Ok(id) = text.parse::<ClassId>() {
        match store.class(id) {
            Err(StoreError::NoClass { .. }) => {}
            found => return Ok(found?),
        }
    }
    class_of_name(store, text)?.ok_or_else(|| {
        let shown: String = text.chars().take(100).collect();
        Problem::new(Code::ClassNotFound, format!("there is no class '{shown}'")).with("class", shown)
    })
}

/// The class called exactly so, which may be a name that no new class gets, or so once the text is put in order.
fn class_of_name(store: &Store, text: &str) -> Result<Option<Class>, StoreError> {
    for name in [ClassName::stored(text), ClassName::new(text)]
        .into_iter()
        .flatten()
    {
        if let Some(class) = store.class_by_name(&name)? {
            return Ok(Some(class));
        }
    }
    Ok(None)
}

fn answer(state: &AppState, status: StatusCode, class: Class) -> Response {
    let live = state.jobs.live_index();
    let tag = format!(
        "\"{}-{}\"",
        version(&class),
        live.generation.as_ref().map_or(0, |g| g.number)
    );
    let body = ClassDto::new(class, live.generation.as_ref());
    let mut response = (status, Json(body)).into_response();
    insert(&mut response, header::ETAG, &tag);
    response
}

/// What changes whenever the class does. The whole tag also has the generation it is seen from, since the answer says
/// how the class stands to that; a reindex is no change of the class, so `if-match` does not look there.
fn version(class: &Class) -> String {
    format!("{}-{}", class.revision, class.updated_at.as_microsecond())
}

/// Whether `if-none-match` has this tag.
pub(super) fn is_at_hand(headers: &HeaderMap, tag: &str) -> bool {
    headers
        .get(header::IF_NONE_MATCH)
        .and_then(|v| v.to_str().ok())
        .is_some_and(|list| {
            list.split(',')
                .map(|one| one.trim().trim_start_matches("W/"))
                .any(|one| one == "*" || one == tag)
        })
}

fn check_match(headers: &HeaderMap, class: &Class) -> Result<(), Problem> {
    let Some(wanted) = headers.get(header::IF_MATCH) else {
        return Ok(());
    };
    let version = version(class);
    let same = |one: &str| {
        let tag = one.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
        one == "*"
            || tag
                .and_then(|t| t.rsplit_once('-'))
                .is_some_and(|(v, _)| v == version)
    };
    let matches = wanted
        .to_str()
        .is_ok_and(|list| list.split(',').any(|one| same(one.trim())));
    if matches {
        Ok(())
    } else {
        Err(Problem::new(
            Code::RevisionMismatch,
            "the class has changed since it was read; read it again",
        )
        .with("revision", class.revision))
    }
}

pub(super) fn insert(response: &mut Response, name: HeaderName, value: &str) {
    // Ids, tags and escaped names are visible ASCII, so the value is always a header value.
    if let Ok(value) = HeaderValue::from_str(value) {
        response.headers_mut().insert(name, value);
    }
}
