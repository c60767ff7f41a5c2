#![no_main]
use libfuzzer_sys::fuzz_target;
use shapelex_core::mesh::Format;

fuzz_target!(init: shapelex_fuzz::panics_of_parsers_are_answers(), |bytes: &[u8]| {
    shapelex_fuzz::mesh::check(bytes, Some(Format::Off));
});
