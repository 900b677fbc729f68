//! Input that is too large, endless or nested without end is refused in one line that names the limit, with little memory.

use super::readers;
use crate::memory;
use std::io::Write;
use std::path::{Path, PathBuf};
use truetwin::fuzzing::banks as bank;
use truetwin::record::Record;
use truetwin::study::StudyFile;

/// The message of a refusal, which may hold so many bytes.
fn refused<T, E: ToString>(most: usize, work: impl FnOnce() -> Result<T, E>) -> String {
    let (outcome, peak) = memory::peak(work);
    let message = outcome.err().expect("must be refused").to_string();
    readers::check_message("limits", &message);
    assert!(peak <= most, "{peak} bytes: {message}");
    message
}

fn place() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn file(place: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = place.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

const MIB: usize = 1 << 20;

#[test]
fn rows_without_end_and_too_many_columns() {
    let place = place();
    for (name, bytes) in [
        (
            "line.csv",
            b"t,u,y\n"
                .iter()
                .copied()
                .chain(std::iter::repeat_n(b'1', 3 * MIB))
                .collect::<Vec<u8>>(),
        ),
        (
            "quote.csv",
            b"t,u,y\n0,1,\""
                .iter()
                .copied()
                .chain(b"2\n".repeat(2 * MIB))
                .collect(),
        ),
        ("header.csv", vec![b'y'; 3 * MIB]),
    ] {
        let path = file(&place, name, &bytes);
        let message = refused(8 * MIB, || Record::read(&path));
        assert!(message.contains("a row of more than 1 MiB"), "{message}");
    }
    let columns: Vec<String> = (1..=3000).map(|j| format!("y{j}")).collect();
    let path = file(
        &place,
        "wide.csv",
        format!("t,{}\n", columns.join(",")).as_bytes(),
    );
    let message = refused(8 * MIB, || Record::read(&path));
    assert!(message.contains("3001 columns, at most 2001"), "{message}");
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_without_end() {
    let zero = Path::new("/dev/zero");
    assert!(refused(8 * MIB, || Record::read(zero)).contains("binary"));
    assert!(refused(8 * MIB, || StudyFile::read(zero)).contains("longer than 1 MiB"));
    assert!(
        refused(8 * MIB, || truetwin::effect::Catalogue::default()
            .read(zero, 1.0))
        .contains("longer than 1 MiB")
    );
    let place = place();
    let pipe = place.path().join("pipe.csv");
    assert!(
        std::process::Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    let writer = pipe.clone();
    std::thread::spawn(move || {
        let mut to = std::fs::OpenOptions::new()
            .write(true)
            .open(writer)
            .unwrap();
        // Ends when nobody reads any more.
        while to.write_all(&[b'7'; 4096]).is_ok() {}
    });
    assert!(refused(8 * MIB, || Record::read(&pipe)).contains("1 MiB"));
}

/// Nested beyond what any stack holds, in every format.
#[test]
fn nesting_without_end() {
    let deep = |open: &str| open.repeat(200_000);
    let all = readers::readers();
    let read = |name: &str| all.iter().find(|(reader, _)| *reader == name).unwrap().1;
    for (reader, text) in [
        ("study", format!("twin = {}", deep("["))),
        ("study", format!("{}a = 1", deep("a."))),
        ("study", format!("twin = {}", deep("{a="))),
        ("study", format!("[{}a]", deep("a."))),
        ("effect", format!("effect = {}", deep("["))),
        ("manifest", deep("[")),
        ("manifest", format!("{{\"schema\": {}", deep("{\"a\":"))),
        ("piece", deep("[")),
        ("description", deep("{\"a\":")),
        ("answer", deep("[")),
        (
            "answer",
            format!("{{\"id\": 1, \"outputs\": {}", deep("{\"y\":")),
        ),
        #[cfg(feature = "fmi")]
        ("fmu", deep("<a>")),
    ] {
        let (outcome, peak) = memory::peak(|| read(reader)(text.as_bytes()));
        let message = outcome.unwrap_err();
        readers::check_message(reader, &message);
        assert!(peak < 200 * text.len() + 16 * MIB, "{reader}: {peak}");
    }
    // Of an array's header NumPy's own parser is not asked.
    let dictionary = format!("{{'descr': {}", deep("("));
    let mut array = b"\x93NUMPY\x02\x00".to_vec();
    array.extend((dictionary.len() as u32).to_le_bytes());
    array.extend(dictionary.bytes());
    assert!(refused(8 * MIB, || readers::bank(&array)).contains("at most 4096"));
}

/// A few bytes that claim to be terabytes.
#[test]
fn arrays_that_claim_to_be_huge() {
    for (shape, part) in [
        ("(1000000000000, 3)", "more than 5e8 numbers"),
        (
            "(18446744073709551615, 18446744073709551615)",
            "does not fit",
        ),
        ("(4294967296, 4294967296)", "does not fit"),
        ("(100000, 1000)", "does not fit the 0 bytes"),
        ("(2,)", "no matrix"),
    ] {
        let dictionary =
            format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut array = b"\x93NUMPY\x01\x00".to_vec();
        array.extend((dictionary.len() as u16).to_le_bytes());
        array.extend(dictionary.bytes());
        let message = refused(MIB, || readers::bank(&array));
        assert!(message.contains(part), "{message}");
    }
}

/// Two archives of 60 kB that unpack to 60 MB, one of them in secret.
#[test]
fn archives_that_are_bombs() {
    let place = place();
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for name in ["theta.npy", "features.npy"] {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(&vec![0; 60 * MIB]).unwrap();
    }
    let bomb = archive.finish().unwrap().into_inner();
    assert!(bomb.len() < 200_000);
    let path = file(&place, "bomb.npz", &bomb);
    let message = refused(MIB, || bank::read(&path, &readers::ab()));
    assert!(message.contains("no array of NumPy"), "{message}");
    let size = (60 * MIB as u32).to_le_bytes();
    let mut lying = bomb;
    while let Some(at) = lying.windows(4).position(|w| w == size) {
        lying[at..at + 4].copy_from_slice(&200u32.to_le_bytes());
    }
    let path = file(&place, "lying.npz", &lying);
    refused(MIB, || bank::read(&path, &readers::ab()));
}

/// A manifest that speaks of a trillion shards costs nothing.
#[test]
fn manifests_of_banks_without_end() {
    let text = |size: &str, rows: &str| {
        format!(
            "{{\"schema\": \"truetwin.bank-folder/1\", \"version\": \"0.1.0\", \"seed\": 1, \"parameters\": [], \
             \"size\": {size}, \"rows of a shard\": {rows}}}"
        )
    };
    for (size, rows) in [
        ("18446744073709551615", "1"),
        ("18446744073709551615", "18446744073709551615"),
        ("1000000000000", "1"),
        ("1000000000000", "16384"),
        ("1e300", "-1"),
    ] {
        refused(2 * MIB, || readers::manifest(text(size, rows).as_bytes()));
    }
}

/// An estimator whose header asks for a billion networks, with a checksum that fits, is refused before any is made.
#[test]
fn estimators_that_ask_for_more_than_they_hold() {
    let whole = std::fs::read(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/fuzz/seeds/estimator/tiny.est"),
    )
    .unwrap();
    assert_eq!(readers::estimator(&whole), Ok(()));
    let at = |what: &[u8]| whole.windows(what.len()).position(|w| w == what).unwrap();
    // In the container the header's quotes are escaped.
    let outputs = at(br#"\"outputs\":1,"#);
    let mut greedy = whole.clone();
    greedy[outputs + 12] = b'9';
    let message = refused(MIB, || readers::estimator(&greedy));
    assert!(message.contains("9 outputs for 1 parameter"), "{message}");
    let mut huge = whole;
    huge[..8].copy_from_slice(&(u64::MAX / 2).to_le_bytes());
    refused(MIB, || readers::estimator(&huge));
}
