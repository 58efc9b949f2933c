//! The description of the API in the OpenAPI format, made from the handlers themselves.

use clerestory_api::{API_PREFIX, PROBLEM_MEDIA_TYPE, Problem};
use utoipa::OpenApi;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, Ref, RefOr, ResponseBuilder};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::http::state::ApiState;
use crate::http::{assets, auth, events, images, integrators, jobs, leases, pieces, workers};

#[derive(OpenApi)]
#[openapi(
    info(
        title = "Clerestory",
        description = "A render farm for the light that old glass throws. Every failure is a problem document (RFC \
                       9457).",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    components(schemas(Problem)),
    tags(
        (name = "jobs", description = "What is to be rendered."),
        (name = "integrators", description = "How scenes may be rendered."),
        (name = "images", description = "What has been rendered, at any moment."),
        (name = "events", description = "What happens, as it happens."),
        (name = "assets", description = "Content that scenes name, by its hash."),
        (name = "workers", description = "Machines that render."),
        (name = "leases", description = "Work given to a worker until a deadline."),
        (name = "session", description = "Browser sessions.")
    )
)]
struct Description;

/// Endpoints that read small bodies.
pub(super) fn small() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new()
        .routes(routes!(auth::open_session))
        .routes(routes!(jobs::list, jobs::submit))
        .routes(routes!(jobs::show))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::release))
        .routes(routes!(jobs::scene))
        .routes(routes!(jobs::convergence))
        .routes(routes!(jobs::live_error))
        .routes(routes!(images::exr))
        .routes(routes!(integrators::list))
        .routes(routes!(events::all))
        .routes(routes!(events::of_job))
        .routes(routes!(workers::list, workers::register))
        .routes(routes!(workers::heartbeat))
        .routes(routes!(workers::end))
        .routes(routes!(workers::release))
        .routes(routes!(leases::claim))
        .routes(routes!(leases::renew))
        .routes(routes!(leases::give_back))
        .routes(routes!(leases::report_scene))
        .routes(routes!(pieces::assemble))
}

/// Endpoints that have parameters in their query.
pub(super) fn with_parameters() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new().routes(routes!(images::preview))
}

/// The endpoints that read partials.
pub(super) fn partials() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new().routes(routes!(leases::partial)).routes(routes!(pieces::put))
}

/// The endpoints that read and write assets as streams.
pub(super) fn streams() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new().routes(routes!(assets::get, assets::head, assets::put))
}

/// The whole description.
pub(crate) fn description() -> utoipa::openapi::OpenApi {
    let endpoints = small().merge(with_parameters()).merge(partials()).merge(streams());
    let (_, mut description) =
        OpenApiRouter::<ApiState>::with_openapi(Description::openapi()).nest(API_PREFIX, endpoints).split_for_parts();
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let problem = ResponseBuilder::new().description("A problem.").content(PROBLEM_MEDIA_TYPE, content).build();
    for item in description.paths.paths.values_mut() {
        let operations = [&mut item.get, &mut item.put, &mut item.post, &mut item.delete, &mut item.head];
        for operation in operations.into_iter().flatten() {
            operation.responses.responses.insert("default".to_owned(), RefOr::T(problem.clone()));
        }
    }
    let bearer = SecurityScheme::Http(HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build());
    description.components.get_or_insert_default().add_security_scheme("token", bearer);
    description.security = Some(vec![SecurityRequirement::new("token", Vec::<String>::new())]);
    description
}

#[cfg(test)]
mod tests {
    /// `UPDATE_OPENAPI=1` writes the file instead.
    #[test]
    fn the_committed_description_is_that_of_the_handlers() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../api/openapi.json");
        let description = super::description().to_pretty_json().unwrap() + "\n";
        if std::env::var_os("UPDATE_OPENAPI").is_some() {
            std::fs::write(file, &description).unwrap();
        }
        let committed = std::fs::read_to_string(file).unwrap_or_default();
        assert!(committed == description, "api/openapi.json is out of date: run this test with UPDATE_OPENAPI=1");
    }
}
