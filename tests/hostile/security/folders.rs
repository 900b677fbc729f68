//! Folders of work from elsewhere: nothing outside of them is read, written or removed.

use super::{done, refused};
use std::fs;
use std::path::{Path, PathBuf};

const BANK: [&str; 9] = [
    "bank",
    "--twin",
    "van-der-pol",
    "--preset",
    "paper",
    "--size",
    "40",
    "--out",
    "bank",
];

/// A place with a bank of three shards.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    done(place.path(), &BANK);
    place
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    found.sort();
    found
}

/// Checksums in a manifest are compared with the names of shards; none of them becomes a path.
#[test]
fn a_manifest_names_no_path() {
    let place = place();
    let manifest = place.path().join("bank/manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let secret = place.path().join("secret.npz");
    fs::copy(&files(&place.path().join("bank/shards"))[0], &secret).unwrap();
    // The last ones are those of shards.
    let checksum = text.split('"').rev().find(|part| part.len() == 64).unwrap();
    for path in ["../../secret", "/etc/passwd", secret.to_str().unwrap()] {
        fs::write(&manifest, text.replace(checksum, path)).unwrap();
        let train = [
            "pretrain",
            "--twin",
            "van-der-pol",
            "--preset",
            "paper",
            "--bank",
            "bank",
            "--out",
            "e.est",
        ];
        let line = refused(place.path(), &train);
        assert!(line.contains("not those of manifest.json"), "{line}");
        let before = files(place.path());
        let line = refused(place.path(), &["merge", "bank", "--out", "merged"]);
        assert!(line.contains("not those of manifest.json"), "{line}");
        assert_eq!(files(place.path()), before);
        // Whole again, as the message says: the names of shards come from their bytes.
        done(place.path(), &BANK);
        done(place.path(), &["merge", "bank", "--out", "merged"]);
        let names = |folder: &str| -> Vec<_> {
            let all = files(&place.path().join(folder).join("shards"));
            all.iter()
                .map(|p| p.file_name().unwrap().to_owned())
                .collect()
        };
        assert_eq!(names("merged"), names("bank"));
        fs::remove_dir_all(place.path().join("merged")).unwrap();
        assert_eq!(files(place.path()), before);
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_a_folder_are_not_followed() {
    use std::os::unix::fs::symlink;
    let place = place();
    let shards = place.path().join("bank/shards");
    let shard = files(&shards)[0].clone();
    // A shard that is a link is refused, though its bytes are right.
    let outside = place.path().join("outside.npz");
    fs::rename(&shard, &outside).unwrap();
    symlink(&outside, &shard).unwrap();
    let line = refused(place.path(), &["merge", "bank", "--out", "m.npz"]);
    assert!(line.contains("no plain file"), "{line}");
    fs::remove_file(&shard).unwrap();
    fs::rename(&outside, &shard).unwrap();
    // A folder of shards that is a link is neither filled nor swept.
    let elsewhere = place.path().join("elsewhere");
    fs::rename(&shards, &elsewhere).unwrap();
    fs::remove_file(&files(&elsewhere)[0]).unwrap();
    fs::write(elsewhere.join(".truetwin-unfinished-4711-a1B2c3"), "").unwrap();
    symlink(&elsewhere, &shards).unwrap();
    let before = files(&elsewhere);
    let line = refused(place.path(), &BANK);
    assert!(line.contains("no folder of its own"), "{line}");
    assert_eq!(files(&elsewhere), before);
    // A manifest that is a link, or a device, makes no folder of a bank.
    let manifest = place.path().join("bank/manifest.json");
    fs::remove_file(&manifest).unwrap();
    symlink("/dev/zero", &manifest).unwrap();
    let line = refused(place.path(), &["merge", "bank", "--out", "m.npz"]);
    assert!(line.contains("no bank folder"), "{line}");
}
