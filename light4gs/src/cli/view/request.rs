//! The head of an HTTP request: what is asked for, and of whom.

use std::ops::Range;

use super::connections::LONGEST_HEAD;

/// What a client asks for.
#[derive(Debug, PartialEq)]
pub(super) enum Request {
    Get {
        path: String,
        /// The part that is wanted, where it is one; other kinds of ranges count as none.
        range: Option<ByteRange>,
    },
    /// Answered like GET, but without the body.
    Head {
        path: String,
    },
    /// It names another host, or none.
    Foreign,
    Other,
}

impl Request {
    /// Reads a head, which ends with an empty line or with the connection.
    pub(super) fn parse(head: &[u8]) -> Self {
        let text = String::from_utf8_lossy(head);
        let mut lines = text.lines();
        let mut words = lines.next().unwrap_or_default().split(' ');
        let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if !matches!(method, "GET" | "HEAD") || !target.starts_with('/') {
            return Self::Other;
        }
        let fields = lines.take_while(|line| !line.is_empty()).filter_map(|line| line.split_once(':'));
        let fields: Vec<(&str, &str)> = fields.map(|(name, value)| (name, value.trim())).collect();
        let called = |wanted: &'static str| {
            fields.iter().filter(move |(name, _)| name.eq_ignore_ascii_case(wanted)).map(|(_, value)| *value)
        };
        let mut hosts = called("host").peekable();
        if hosts.peek().is_none() || !hosts.all(is_this_machine) {
            return Self::Foreign;
        }
        let path = target.split(['?', '#']).next().unwrap_or_default().to_owned();
        match method {
            "HEAD" => Self::Head { path },
            _ => Self::Get { path, range: called("range").next().and_then(ByteRange::parse) },
        }
    }
}

/// A single range of bytes (RFC 9110, section 14.1.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ByteRange {
    /// From a byte on, to another or to the end.
    From(u64, Option<u64>),
    /// So many at the end.
    Last(u64),
}

impl ByteRange {
    fn parse(text: &str) -> Option<Self> {
        let (from, to) = text.strip_prefix("bytes=")?.split_once('-')?;
        match (from.is_empty(), to.is_empty()) {
            (true, _) => to.parse().ok().map(Self::Last),
            (false, true) => Some(Self::From(from.parse().ok()?, None)),
            (false, false) => {
                let (from, to): (u64, u64) = (from.parse().ok()?, to.parse().ok()?);
                (from <= to).then_some(Self::From(from, Some(to)))
            }
        }
    }

    /// Its bytes of a content of this length; `None` where there are none.
    pub(super) fn within(self, length: u64) -> Option<Range<u64>> {
        let range = match self {
            Self::From(from, to) => from..to.map_or(length, |to| to.saturating_add(1).min(length)),
            Self::Last(count) => length.saturating_sub(count)..length,
        };
        (range.start < range.end).then_some(range)
    }
}

fn is_this_machine(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    matches!(name, "127.0.0.1" | "localhost")
}

/// Where a head ends in `bytes`, whose first `known` have no end of one. [`None`] while more must come.
pub(super) fn end_of_head(bytes: &[u8], known: usize) -> Option<usize> {
    // An end may lie across the border.
    let from = known.saturating_sub(3);
    let new = &bytes[from..];
    let end = |mark: &[u8]| new.windows(mark.len()).position(|window| window == mark).map(|at| from + at + mark.len());
    [end(b"\r\n\r\n"), end(b"\n\n")].into_iter().flatten().min().filter(|&end| end <= LONGEST_HEAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_and_foreign_hosts_refused() {
        let parse = |text: &str| Request::parse(text.as_bytes());
        let get = |path: &str| Request::Get { path: path.to_owned(), range: None };
        assert_eq!(parse("GET /scene.l4gs?version=3 HTTP/1.1\r\nHost: 127.0.0.1:4000\r\n\r\n"), get("/scene.l4gs"));
        assert_eq!(parse("GET / HTTP/1.1\r\nhost:localhost\r\n\r\n"), get("/"));
        for foreign in ["evil.example:4000", "127.0.0.1.evil.example", "localhost\r\nHost: evil.example", ""] {
            assert_eq!(parse(&format!("GET / HTTP/1.1\r\nHost: {foreign}\r\n\r\n")), Request::Foreign);
        }
        assert_eq!(parse("GET / HTTP/1.1\r\n\r\nHost: localhost"), Request::Foreign);
        for other in ["POST / HTTP/1.1\r\n\r\n", "", "\r\n", "GET", "GET http://x/ HTTP/1.1\r\n\r\n"] {
            assert_eq!(parse(other), Request::Other);
        }
        assert_eq!(Request::parse(&[0xff, 0xfe, b'\n']), Request::Other);
    }

    #[test]
    fn a_head_ends_with_an_empty_line_however_it_comes() {
        let text = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\nbody";
        let end = text.len() - 4;
        assert!((0..end).all(|known| end_of_head(&text[..end - 1], known.min(end - 1)).is_none()));
        assert!((0..end).all(|known| end_of_head(text, known) == Some(end)));
        assert_eq!(end_of_head(b"GET /\n\n", 0), Some(7));
        assert_eq!(end_of_head(&[vec![b' '; LONGEST_HEAD], b"\n\n".to_vec()].concat(), 0), None);
    }
}
