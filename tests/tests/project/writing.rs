//! How sources and documents are written: short files, narrow lines, short sentences.
//!
//! Sentences are checked in module headers (`//!`) and in the prose of Markdown files. Code blocks, tables and headings
//! are no prose. A code span counts as one word, and so does a formula without spaces.

#![expect(clippy::unwrap_used, reason = "a test that cannot read its own workspace has failed")]

use std::collections::BTreeSet;
use std::path::Path;

/// Lines of a Rust file. Longer tables are data files.
const MOST_LINES: usize = 600;

/// Characters of a line.
const MOST_COLUMNS: usize = 120;

/// Words of a sentence.
const MOST_WORDS: usize = 25;

/// Folders with files that people of this project write. The files of the root are added.
const FOLDERS: [&str; 7] = [".ci", "api", "crates", "deploy", "docs", "scenes", "tests"];

/// Folders with files that others wrote, that commands write, or that are test data.
const FOREIGN_FOLDERS: [&str; 3] = ["target", "tests/data", "crates/coordinator/dashboard/vendor"];

/// Endings of checked files. Others are data or are generated.
const ENDINGS: [&str; 9] = ["rs", "md", "html", "css", "js", "sh", "toml", "yaml", "py"];

/// Checked files without an ending.
const SCRIPTS: [&str; 2] = ["tests/run", ".ci/run"];

/// Words with a full stop that end no sentence.
const ABBREVIATIONS: [&str; 5] = ["al.", "e.g.", "i.e.", "cf.", "vs."];

#[test]
fn files_are_short_lines_are_narrow_and_sentences_are_short() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let findings: Vec<String> =
        files(root).iter().flat_map(|file| check(file, &std::fs::read_to_string(root.join(file)).unwrap())).collect();
    assert!(findings.is_empty(), "{} findings:\n{}", findings.len(), findings.join("\n"));
}

/// The checked files, by their paths from the root.
fn files(root: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open: Vec<String> = FOLDERS.map(str::to_owned).into();
    let mut add = |path: String, open: Option<&mut Vec<String>>| {
        let full = root.join(&path);
        let ending = full.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if full.is_dir() {
            open.into_iter().for_each(|open| open.push(path.clone()));
        } else if ENDINGS.contains(&ending) || SCRIPTS.contains(&path.as_str()) {
            found.insert(path);
        }
    };
    let names = |folder: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
        entries.map(|name| name.into_string().unwrap()).collect()
    };
    names(root).into_iter().for_each(|name| add(name, None));
    while let Some(folder) = open.pop() {
        if !FOREIGN_FOLDERS.contains(&folder.as_str()) {
            let paths = names(&root.join(&folder)).into_iter().map(|name| format!("{folder}/{name}"));
            paths.for_each(|path| add(path, Some(&mut open)));
        }
    }
    assert!(found.contains("README.md") && found.contains("tests/run"), "the files of the project were not found");
    found
}

/// What is wrong with a file, each with the file and the line.
fn check(file: &str, text: &str) -> Vec<String> {
    let (is_rust, is_markdown) = (file.ends_with(".rs"), file.ends_with(".md"));
    let mut findings = Vec::new();
    let count = text.lines().count();
    if is_rust && count > MOST_LINES {
        findings.push(format!("{file}:{count}: {count} lines, at most {MOST_LINES}"));
    }
    for (number, line) in (1..).zip(text.lines()) {
        let columns = columns(line);
        // A row of a table is one line.
        if columns > MOST_COLUMNS && !(is_markdown && line.starts_with('|')) {
            findings.push(format!("{file}:{number}: {columns} columns, at most {MOST_COLUMNS}"));
        }
    }
    let lines = (1..).zip(text.lines());
    let paragraphs = match (is_rust, is_markdown) {
        (true, _) => paragraphs(lines.filter_map(|(number, line)| Some((number, header(line)?)))),
        (_, true) => paragraphs(lines),
        _ => Vec::new(),
    };
    for (number, paragraph) in paragraphs {
        for sentence in sentences(&paragraph) {
            let words = sentence.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count();
            if words > MOST_WORDS {
                findings.push(format!("{file}:{number}: {words} words, at most {MOST_WORDS}: {sentence}"));
            }
        }
    }
    findings
}

/// The width of a line without its URLs, which cannot be broken.
fn columns(line: &str) -> usize {
    let urls = line.split_whitespace().filter(|word| word.contains("://"));
    line.chars().count() - urls.map(|url| url.chars().count()).sum::<usize>()
}

/// The text of a line of a module header.
fn header(line: &str) -> Option<&str> {
    let text = line.trim_start().strip_prefix("//!")?;
    Some(text.strip_prefix(' ').unwrap_or(text))
}

/// The paragraphs and the items of lists, each with the line on which it begins.
fn paragraphs<'a>(lines: impl Iterator<Item = (usize, &'a str)>) -> Vec<(usize, String)> {
    let mut paragraphs: Vec<(usize, String)> = Vec::new();
    let (mut is_open, mut is_code) = (false, false);
    for (number, line) in lines {
        let text = line.trim();
        let is_fence = text.starts_with("```");
        is_code ^= is_fence;
        let is_indented_code = line.starts_with("    ") && !is_open;
        if is_fence || is_code || text.is_empty() || text.starts_with(['#', '|', '<']) || is_indented_code {
            is_open = false;
        } else if let Some(item) = list_item(text) {
            paragraphs.push((number, item.to_owned()));
            is_open = true;
        } else if let Some((_, paragraph)) = paragraphs.last_mut().filter(|_| is_open) {
            *paragraph += " ";
            *paragraph += text;
        } else {
            paragraphs.push((number, text.to_owned()));
            is_open = true;
        }
    }
    paragraphs
}

/// The text of an item of a list.
fn list_item(text: &str) -> Option<&str> {
    let (mark, item) = text.split_once(' ')?;
    let is_number = || mark.strip_suffix('.').is_some_and(|digits| digits.parse::<u32>().is_ok());
    (matches!(mark, "-" | "*" | "+") || is_number()).then_some(item)
}

/// The sentences of a paragraph.
fn sentences(paragraph: &str) -> Vec<String> {
    let paragraph = read_aloud(paragraph);
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    let mut sentences = vec![Vec::new()];
    for (index, word) in words.iter().enumerate() {
        sentences.last_mut().unwrap().push(*word);
        let bare = word.trim_end_matches([')', '"', '*', '_']);
        let ends = bare.ends_with(['.', '!', '?']) && !ABBREVIATIONS.contains(&bare);
        if ends && !words.get(index + 1).is_some_and(|next| next.starts_with(char::is_lowercase)) {
            sentences.push(Vec::new());
        }
    }
    sentences.into_iter().map(|words| words.join(" ")).filter(|sentence| !sentence.is_empty()).collect()
}

/// A paragraph with one word for each code span, and without the targets of links.
fn read_aloud(paragraph: &str) -> String {
    let mut text = String::new();
    let mut rest = paragraph;
    while let Some(place) = rest.find(['`', '[', ']']) {
        let after = &rest[place + 1..];
        text += &rest[..place];
        let end = match (rest[place..].starts_with('`'), after.starts_with('(')) {
            (true, _) => {
                text += "`code`";
                after.find('`')
            }
            (false, true) => after.find(')'),
            (false, false) => {
                rest = after;
                continue;
            }
        };
        rest = end.map_or("", |end| &after[end + 1..]);
    }
    text + rest
}

#[test]
fn long_files_wide_lines_and_long_sentences_are_found() {
    #[track_caller]
    fn finds(file: &str, text: &str, expected: &[&str]) {
        let found: Vec<String> = check(file, text).iter().map(|found| found.chars().take(20).collect()).collect();
        assert_eq!(found, expected);
    }
    let words = |count: usize| "Word ".repeat(count);
    finds("a.rs", &"fn f() {}\n".repeat(601), &["a.rs:601: 601 lines,"]);
    finds("a.js", &format!("x\n{}", "y".repeat(121)), &["a.js:2: 121 columns,"]);
    finds("a.md", &format!("| {}\nhttps://{}", "y".repeat(121), "x".repeat(200)), &[]);
    finds("a.rs", &format!("//! {}\n//! {}.", words(20), words(6)), &["a.rs:1: 26 words, at"]);
    finds("a.rs", &format!("// {}\n// {}.", words(20), words(20)), &[]);
    finds("a.md", &format!("# T\n\n- {}\n  {}.\n", words(20), words(6)), &["a.md:3: 26 words, at"]);
    finds("a.md", &format!("{}.\n{}.\n\n```\n{}\n```\n", words(20), words(20), words(23)), &[]);
}

#[test]
fn sentences_end_where_a_reader_stops() {
    #[track_caller]
    fn check(paragraph: &str, expected: &[&str]) {
        assert_eq!(sentences(paragraph), expected);
    }
    check("One. Two! `a. b` three? Four", &["One.", "Two!", "`code` three?", "Four"]);
    check(
        "After Hanika et al. 2015, section 3. Then [text](docs/a. b.md).",
        &["After Hanika et al. 2015, section 3.", "Then text."],
    );
    check(
        "It costs 0.5 ms. (Less is free.) **Why.** See `a.rs`.",
        &["It costs 0.5 ms.", "(Less is free.)", "**Why.**", "See `code`."],
    );
}
