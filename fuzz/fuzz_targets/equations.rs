#![no_main]

#[path = "../../tests/hostile/fuzz/readers.rs"]
mod readers;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    readers::hold("equations", readers::equations, data);
});
