//! What the fuzz targets check. `tests/fuzz_corpus` of the main crate includes these files too and replays the corpora.

#[cfg(feature = "service")]
pub mod archive;
pub mod mesh;
pub mod polygon;
#[cfg(feature = "service")]
pub mod request;

/// The readers answer a panic of a third-party parser with a problem, so such a panic is no finding; one of our own
/// code is. libFuzzer's hook would end the process at either.
pub fn panics_of_parsers_are_answers() {
    let abort = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !info
            .location()
            .is_some_and(|l| l.file().contains("/registry/src/"))
        {
            abort(info);
        }
    }));
}
