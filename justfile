# The commands of a working day. `just` lists them.

_default:
    @just --list

# Formatting and lints
check:
    cargo fmt --check
    cargo clippy --locked --release --workspace --all-targets --features otlp,tls -- -D warnings

# All tests, or those of one program: `just test service`
test *name:
    cargo test --release --locked {{ if name == "" { "" } else { "--test " + name } }}

# What has to pass before a change is merged
ci:
    .ci/run

# A zoo, a service, queries over HTTP
demo:
    cargo run --release -- demo

# Benchmarks of the stages
bench:
    cargo bench --bench eigen --bench coding --bench query

# The API document, after routes were changed
openapi:
    UPDATE_OPENAPI=1 cargo test --release --test service openapi_yaml

# The documentation of the library
docs:
    cargo doc --no-deps --workspace --open

# Licences, advisories and sources of the dependencies
deny:
    cargo deny check
