//! The structure of the sources: a *room* is a folder or file directly under a crate's `src`. Imports between the rooms
//! of a crate form no circle.
//!
//! The paths that begin with `crate`, `super` or `self` are read from the sources as text; names that the crate's root
//! exports again count for the room that they come from. `$crate` in a macro counts for the room of the macro. Unit tests count
//! as well: one that needs a room above its own stands in that room, or in `tests/`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The crates that have rooms.
const CRATES: [&str; 11] = [
    "crates/light4gs-keys",
    "light4gs-codec",
    "light4gs-data",
    "crates/light4gs-lab",
    "crates/light4gs-render",
    "crates/light4gs-report",
    "light4gs",
    "light4gs-model",
    "light4gs-train",
    "bindings/web",
    "bindings/c",
];

#[test]
fn imports_between_rooms_form_no_circle() {
    let circles: Vec<String> = CRATES.iter().flat_map(|name| circles(&root().join(name).join("src"))).collect();
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

/// In ARCHITECTURE.md a crate is an entry of a list, and the folders of its sources are named there.
#[test]
fn the_map_has_every_crate_and_its_folders() {
    let map = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let mut lacking = Vec::new();
    for name in members() {
        let Some((_, entry)) = map.split_once(&format!("**`{name}`**")) else {
            lacking.push(name);
            continue;
        };
        let entry = entry.split("\n- **").next().unwrap_or_default();
        for folder in folders(&root().join(&name).join("src")) {
            // `bin` is Cargo's.
            if folder != "bin" && !entry.contains(&format!("`{folder}/`")) {
                lacking.push(format!("{name}/src/{folder}/"));
            }
        }
    }
    assert!(lacking.is_empty(), "not in ARCHITECTURE.md: {}", lacking.join(", "));
}

/// The folders of the crates of the workspace, as the root's `Cargo.toml` lists them.
fn members() -> Vec<String> {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("Cargo.toml");
    let (_, members) = manifest.split_once("members = [").expect("a list of members");
    let (members, _) = members.split_once(']').expect("the end of the list");
    // Every second piece is between quotation marks.
    let members = members.split('"').skip(1).step_by(2).flat_map(|member| match member.strip_suffix("/*") {
        None => vec![member.to_owned()],
        Some(parent) => folders(&root().join(parent)).iter().map(|name| format!("{parent}/{name}")).collect(),
    });
    members.collect()
}

/// The names of the folders in a folder; none where it is not there.
fn folders(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry"));
    let folders = entries.filter(|entry| entry.path().is_dir());
    folders.map(|entry| entry.file_name().into_string().expect("UTF-8")).collect()
}

#[test]
fn a_circle_is_found() {
    let folder = std::env::temp_dir().join(format!("light4gs-rooms-{}", std::process::id()));
    let source = folder.join("src");
    fs::create_dir_all(source.join("upper")).expect("a folder for the test");
    let write = |name: &str, text: &str| fs::write(source.join(name), text).expect("a file for the test");
    write("lib.rs", "mod lower; mod middle; mod upper;\npub use upper::{inner::Deep as Shown, Top};");
    write("lower.rs", "// crate::upper\nconst TEXT: &str = \"crate::upper\"; pub struct Low;");
    write("middle.rs", "use super::lower::Low;\nfn f(low: Low) { crate::Shown::new(low) }");
    write("upper/mod.rs", "pub mod inner;\npub struct Top;");
    write("upper/inner.rs", "pub struct Deep;\nmod tests { use super::super::Top; }");
    assert_eq!(circles(&source), Vec::<String>::new());
    write("lower.rs", "use crate::{middle::{self, f}};\npub struct Low;");
    let found = circles(&source);
    fs::remove_dir_all(&folder).expect("the test's folder goes away");
    let [circle] = &found[..] else { panic!("one circle, not {found:?}") };
    for part in ["lower.rs:1 middle", "middle.rs:1 lower"] {
        assert!(circle.contains(part), "{part}: {circle}");
    }
}

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_path_buf()
}

/// The circles among the rooms of the crate whose sources are in `source`, each with the imports that make it.
fn circles(source: &Path) -> Vec<String> {
    let mut files = Vec::new();
    collect(source, &mut files);
    let sources: Vec<Source> = files.iter().map(|file| Source::read(source, file)).collect();
    let lib = sources.iter().find(|file| file.name == "lib.rs").expect("lib.rs");
    let shown = Shown::of(lib, &sources);
    // For each room the rooms that it imports, each with one place of such an import.
    let mut imports: BTreeMap<&str, BTreeMap<String, String>> = BTreeMap::new();
    for file in sources.iter().filter(|file| file.name != "lib.rs" && file.name != "main.rs") {
        let here = file.modules[0].as_str();
        for (line, path) in file.paths() {
            let Some(room) = path.first().and_then(|name| shown.room(name)) else { continue };
            if room != here {
                let place = format!("{}:{line} {room}", file.name);
                imports.entry(here).or_default().entry(room).or_insert(place);
            }
        }
    }
    let reached: BTreeMap<&str, BTreeSet<&str>> = imports.keys().map(|room| (*room, reach(&imports, room))).collect();
    let mut done = BTreeSet::new();
    let mut found = Vec::new();
    for (&room, all) in &reached {
        if !all.contains(room) || done.contains(room) {
            continue;
        }
        let members: BTreeSet<&str> =
            all.iter().copied().filter(|other| reached.get(other).is_some_and(|back| back.contains(room))).collect();
        let mut text =
            format!("{}: a circle of {}", source.display(), members.iter().copied().collect::<Vec<_>>().join(", "));
        for member in &members {
            for place in imports[member].iter().filter(|(to, _)| members.contains(to.as_str())).map(|(_, place)| place)
            {
                text.push_str(&format!("\n  {place}"));
            }
        }
        done.extend(members);
        found.push(text);
    }
    found
}

/// The rooms that `room` imports, and those that they import.
fn reach<'a>(imports: &'a BTreeMap<&str, BTreeMap<String, String>>, room: &'a str) -> BTreeSet<&'a str> {
    let mut all = BTreeSet::new();
    let mut open = vec![room];
    while let Some(next) = open.pop() {
        for other in imports.get(next).into_iter().flat_map(|others| others.keys()) {
            if all.insert(other.as_str()) {
                open.push(other);
            }
        }
    }
    all
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("sources").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for entry in entries {
        if entry.is_dir() {
            collect(&entry, files);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            files.push(entry);
        }
    }
}

/// One file, cut into words.
struct Source {
    /// The path below `src`.
    name: String,
    /// The path of its module below the crate; empty for the crate's root.
    modules: Vec<String>,
    /// Words and signs with their lines; comments and literals are left out.
    words: Vec<(usize, String)>,
}

impl Source {
    fn read(source: &Path, file: &Path) -> Self {
        let below = file.strip_prefix(source).expect("a file of the folder");
        let mut modules: Vec<String> =
            below.with_extension("").iter().map(|part| part.to_str().expect("UTF-8").to_string()).collect();
        if matches!(modules.last().map(String::as_str), Some("mod" | "lib" | "main")) {
            modules.pop();
        }
        let text = fs::read_to_string(file).expect("a source");
        Self { name: below.to_str().expect("UTF-8").replace('\\', "/"), modules, words: words(&text) }
    }

    /// The paths that begin at the crate's root, with `super` and `self` resolved, and the lines that they stand in.
    fn paths(&self) -> Vec<(usize, Vec<String>)> {
        let mut found = Vec::new();
        // The inline modules that a place is in, each with the depth of braces around it.
        let mut inline: Vec<(usize, String)> = Vec::new();
        let mut depth = 0;
        let mut at = 0;
        while at < self.words.len() {
            match self.word(at) {
                "{" => depth += 1,
                "}" => {
                    depth -= 1;
                    inline.retain(|(outside, _)| *outside < depth);
                }
                "mod" if self.word(at + 2) == "{" => inline.push((depth, self.word(at + 1).to_string())),
                "crate" | "super" | "self" if self.word(at + 1) == "::" && (at == 0 || self.word(at - 1) != "::") => {
                    let mut modules = self.modules.clone();
                    modules.extend(inline.iter().map(|(_, name)| name.clone()));
                    let line = self.words[at].0;
                    let mut paths = Vec::new();
                    at = self.tree(at, &modules, &mut paths);
                    found.extend(paths.into_iter().map(|path| (line, path)));
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        found
    }

    fn word(&self, at: usize) -> &str {
        self.words.get(at).map_or("", |(_, word)| word)
    }

    /// Reads the path or tree of paths at `at` behind `before`, and returns the place behind it.
    fn tree(&self, mut at: usize, before: &[String], paths: &mut Vec<Vec<String>>) -> usize {
        let mut path = before.to_vec();
        loop {
            match self.word(at) {
                "{" => {
                    at += 1;
                    while !matches!(self.word(at), "}" | "") {
                        at = self.tree(at, &path, paths);
                        if self.word(at) == "as" {
                            at += 2;
                        }
                        if self.word(at) == "," {
                            at += 1;
                        }
                    }
                    return at + 1;
                }
                "crate" => path.clear(),
                "super" => drop(path.pop()),
                "self" => {}
                name => path.push(name.to_string()),
            }
            at += 1;
            if self.word(at) != "::" {
                paths.push(path);
                return at;
            }
            at += 1;
        }
    }
}

/// The names that a crate's root exports, and the rooms that they come from.
struct Shown(BTreeMap<String, String>);

impl Shown {
    fn of(lib: &Source, sources: &[Source]) -> Self {
        let mut rooms = BTreeMap::new();
        for at in 0..lib.words.len() {
            if lib.word(at) == "mod" {
                rooms.insert(lib.word(at + 1).to_string(), lib.word(at + 1).to_string());
            }
        }
        for (shown, path) in exports(lib) {
            let room = path[0].clone();
            if shown == "*" {
                let inside = sources.iter().find(|file| file.modules == path);
                for name in inside.into_iter().flat_map(items) {
                    rooms.entry(name).or_insert(room.clone());
                }
            } else {
                rooms.entry(shown).or_insert(room);
            }
        }
        Self(rooms)
    }

    fn room(&self, name: &str) -> Option<String> {
        self.0.get(name).cloned()
    }
}

/// The names that a file exports again, with what they stand for.
fn exports(file: &Source) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < file.words.len() {
        let is_use = file.word(at) == "use" && at > 0 && matches!(file.word(at - 1), "pub" | ")");
        at += 1;
        if is_use {
            let mut end = at;
            while !matches!(file.word(end), ";" | "") {
                end += 1;
            }
            renamed(file, at, &[], &mut found);
            at = end;
        }
    }
    found
}

/// Like [`Source::tree`], with the names under which the paths are known here.
fn renamed(file: &Source, mut at: usize, before: &[String], found: &mut Vec<(String, Vec<String>)>) -> usize {
    let mut path = before.to_vec();
    loop {
        match file.word(at) {
            "{" => {
                at += 1;
                while !matches!(file.word(at), "}" | "") {
                    at = renamed(file, at, &path, found);
                    if file.word(at) == "," {
                        at += 1;
                    }
                }
                return at + 1;
            }
            "crate" | "self" => {}
            name => path.push(name.to_string()),
        }
        at += 1;
        if file.word(at) != "::" {
            break;
        }
        at += 1;
    }
    let mut name = path.last().cloned().unwrap_or_default();
    if name == "*" {
        path.pop();
    }
    if file.word(at) == "as" {
        name = file.word(at + 1).to_string();
        at += 2;
    }
    found.push((name, path));
    at
}

/// The names that a file declares or exports again for everybody.
fn items(file: &Source) -> Vec<String> {
    let declared = (0..file.words.len()).filter(|at| {
        file.word(*at) == "pub"
            && matches!(file.word(at + 1), "struct" | "enum" | "trait" | "fn" | "type" | "const" | "static" | "mod")
    });
    let mut names: Vec<String> = declared.map(|at| file.word(at + 2).to_string()).collect();
    names.extend(exports(file).into_iter().map(|(name, _)| name));
    names
}

/// Cuts a source into words and signs with their lines; comments, strings and characters are left out.
fn words(text: &str) -> Vec<(usize, String)> {
    let bytes = text.as_bytes();
    let mut words = Vec::new();
    let (mut at, mut line) = (0, 1);
    let is_word = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    while at < bytes.len() {
        let rest = &text[at..];
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(length) = raw_string(rest) {
            length
        } else if rest.starts_with('"') {
            quoted(rest, b'"')
        } else if rest.starts_with('\'') {
            // A character, not a lifetime, is closed behind one character or an escape.
            let closes = rest.chars().nth(2) == Some('\'') || rest.starts_with("'\\");
            if closes { quoted(rest, b'\'') } else { 1 }
        } else if is_word(bytes[at]) {
            let length = rest.bytes().position(|byte| !is_word(byte)).unwrap_or(rest.len());
            words.push((line, rest[..length].to_string()));
            length
        } else if rest.starts_with("::") {
            words.push((line, "::".to_string()));
            2
        } else {
            let sign = rest.chars().next().expect("something is left");
            if !sign.is_whitespace() {
                words.push((line, sign.to_string()));
            }
            sign.len_utf8()
        };
        line += rest[..length].matches('\n').count();
        at += length;
    }
    words
}

/// The length of the raw string that `rest` begins with.
fn raw_string(rest: &str) -> Option<usize> {
    let inside = rest.strip_prefix("br").or_else(|| rest.strip_prefix('r'))?;
    let signs = inside.bytes().take_while(|byte| *byte == b'#').count();
    let begin = rest.len() - inside.len() + signs + 1;
    inside[signs..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(signs));
    Some(rest[begin..].find(&end).map_or(rest.len(), |at| begin + at + end.len()))
}

/// The length of the literal between `mark`s that `rest` begins with.
fn quoted(rest: &str, mark: u8) -> usize {
    let mut escaped = false;
    for (at, byte) in rest.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            _ if byte == mark => return at + 1,
            _ => {}
        }
    }
    rest.len()
}
