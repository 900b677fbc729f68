//! Files that are nearly right: a seed with a few changes of the kinds that break readers.

use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Numbers at the edges of what numbers can be.
const NUMBERS: [&str; 22] = [
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "NaN",
    "-nan",
    "inf",
    "-Infinity",
    "-0",
    "0",
    "-1",
    "0.5",
    "1e0",
    "2147483648",
    "9007199254740993",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e18",
    "0x10",
    "00",
];

/// Pieces that mean something to one reader or another, or to a terminal.
const PIECES: [&[u8]; 38] = [
    b"\0",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\xc3\x28",
    b"\r\n",
    b"\n\n",
    b"\"",
    b"'",
    b"\"\"\"",
    b"\\",
    b"\\u0000",
    b"\\ud800",
    b",",
    b",,",
    b";",
    b"\t",
    b"#",
    b"=",
    b"[",
    b"]",
    b"{",
    b"}",
    b"[[",
    b"null",
    b"true",
    b"../../etc/x",
    b"/etc/x",
    b"\x1b[2J",
    b"\xc2\x9b31m",
    b"\xe2\x80\xae",
    b"<script>",
    b"&amp;",
    b"&#0;",
    b"<!DOCTYPE a [<!ENTITY b \"b\">]>",
    b"<![CDATA[",
    b"PK\x05\x06",
    b"__proto__",
    b"%n",
];

/// `seed` after one to four changes; `other` is what is spliced in.
pub fn mutated(seed: &[u8], other: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..random.gen_range(1..=4) {
        change(&mut bytes, other, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut ChaCha8Rng) {
    let length = bytes.len();
    let at = random.gen_range(0..=length);
    let span = at..(at + 1 + random.gen_range(0..24)).min(length).max(at);
    match random.gen_range(0..15) {
        0 if length > 0 => bytes[at.min(length - 1)] ^= 1 << random.gen_range(0..8),
        1 if length > 0 => bytes[at.min(length - 1)] = random.r#gen(),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(span)),
        4 => {
            let copy = bytes[span].to_vec();
            bytes.splice(at..at, copy);
        }
        5 => {
            let from = random.gen_range(0..=other.len());
            bytes.truncate(at);
            bytes.extend_from_slice(&other[from..]);
        }
        6 | 7 => insert(bytes, at, PIECES.choose(random).copied().unwrap_or(b"")),
        8..=10 => replace_number(bytes, at, random),
        11 => repeat_line(bytes, at),
        12 => nest(bytes, at, random),
        13 => huge_length(bytes, at, random),
        _ => {
            let ends = bytes.iter().filter(|b| **b == b'\n').count();
            if ends > 0 {
                *bytes = bytes
                    .iter()
                    .flat_map(|b| match b {
                        b'\n' => vec![b'\r', b'\n'],
                        b => vec![*b],
                    })
                    .collect();
            }
        }
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, what: &[u8]) {
    bytes.splice(at..at, what.iter().copied());
}

/// The next number of a text, after `at` or else from the start, becomes one at the edge.
fn replace_number(bytes: &mut Vec<u8>, at: usize, random: &mut ChaCha8Rng) {
    let digit = |b: &u8| b.is_ascii_digit();
    let Some(begin) = (bytes[at..].iter().position(digit).map(|k| at + k))
        .or_else(|| bytes.iter().position(digit))
    else {
        return;
    };
    let part = |b: &u8| b.is_ascii_digit() || b".eE+-".contains(b);
    let end = begin + bytes[begin..].iter().take_while(|b| part(b)).count();
    let number = NUMBERS.choose(random).copied().unwrap_or("0");
    bytes.splice(begin..end, number.bytes());
}

/// The line at `at` stands there once more: duplicate keys, columns, rows.
fn repeat_line(bytes: &mut Vec<u8>, at: usize) {
    let begin = bytes[..at]
        .iter()
        .rposition(|b| *b == b'\n')
        .map_or(0, |k| k + 1);
    let end = bytes[at..]
        .iter()
        .position(|b| *b == b'\n')
        .map_or(bytes.len(), |k| at + k + 1);
    let line = bytes[begin..end].to_vec();
    bytes.splice(begin..begin, line);
}

/// Brackets, tables, keys or elements inside each other.
fn nest(bytes: &mut Vec<u8>, at: usize, random: &mut ChaCha8Rng) {
    let opening: [&[u8]; 7] = [b"[", b"{\"a\":", b"{a=", b"a.", b"<a>", b"(", b"[["];
    let what = opening.choose(random).copied().unwrap_or(b"[");
    insert(bytes, at, &what.repeat(random.gen_range(10..4000)));
}

/// Four or eight bytes that claim a length.
fn huge_length(bytes: &mut [u8], at: usize, random: &mut ChaCha8Rng) {
    let lengths = [
        u64::MAX,
        1 << 63,
        1 << 32,
        1 << 31,
        (1 << 32) - 1,
        (1 << 31) - 1,
        0,
        1,
    ];
    let length = lengths.choose(random).copied().unwrap_or(0).to_le_bytes();
    let width = if random.r#gen() { 4 } else { 8 };
    for (byte, new) in bytes[at..].iter_mut().zip(&length[..width]) {
        *byte = *new;
    }
}
