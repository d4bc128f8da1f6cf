//! The connections of the server: how many there are at once, and how long each may take.
//!
//! Whoever opens many connections, or sends and reads slowly, must not keep others out: a new connection takes the place of one
//! that waits for its client.

use std::io::{ErrorKind, Read, Result, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::request::end_of_head;

/// More bytes than the head of a browser's request takes.
pub(super) const LONGEST_HEAD: usize = 32 << 10;
/// Connections at once.
const MOST: usize = 128;
/// For the whole head of a request, and for each piece of an answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// A client that has taken no piece of its answer for so long may lose its place to a new one.
const STALLED: Duration = Duration::from_secs(1);
/// For a client to close its end after the answer.
const FAREWELL: Duration = Duration::from_secs(2);
/// Bytes of a piece.
const PIECE: usize = 64 << 10;

/// What a connection is doing.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Its client is to send something, or to close its end.
    Waiting,
    /// An answer is being made.
    Working,
    /// An answer is being sent; since the last piece was taken.
    Sending(Instant),
}

/// A connection with a client.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    phase: Mutex<Phase>,
}

/// Why there is no head of a request.
#[derive(Debug, PartialEq)]
pub(super) enum NoHead {
    TooLong,
    TooLate,
    /// The connection broke.
    Gone,
}

impl Connection {
    fn new(stream: TcpStream) -> Self {
        Self { stream, phase: Mutex::new(Phase::Waiting) }
    }

    fn set(&self, phase: Phase) {
        *self.phase.lock().unwrap_or_else(PoisonError::into_inner) = phase;
    }

    /// Reads up to the empty line, or to the end of what the client sends.
    pub(super) fn read_head(&self) -> std::result::Result<Vec<u8>, NoHead> {
        let deadline = Instant::now() + PATIENCE;
        let (mut head, mut piece) = (Vec::new(), [0; 4 << 10]);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(NoHead::TooLate);
            }
            // The error is one of a duration of zero.
            let _ = self.stream.set_read_timeout(Some(left));
            let known = head.len();
            match (&self.stream).read(&mut piece) {
                Ok(0) => break,
                Ok(count) => head.extend_from_slice(&piece[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
                Err(_) => return Err(NoHead::Gone),
            }
            if let Some(end) = end_of_head(&head, known) {
                head.truncate(end);
                break;
            }
            if head.len() > LONGEST_HEAD {
                return Err(NoHead::TooLong);
            }
        }
        self.set(Phase::Working);
        Ok(head)
    }

    /// Sends bytes, as long as the client takes each piece of them in time.
    pub(super) fn send(&self, bytes: &[u8]) -> Result<()> {
        for piece in bytes.chunks(PIECE) {
            let begin = Instant::now();
            self.set(Phase::Sending(begin));
            let mut rest = piece;
            while !rest.is_empty() {
                let left = PATIENCE.saturating_sub(begin.elapsed());
                if left.is_zero() {
                    return Err(ErrorKind::TimedOut.into());
                }
                self.stream.set_write_timeout(Some(left))?;
                match (&self.stream).write(rest) {
                    Ok(count) => rest = &rest[count..],
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }

    /// Ends the answer, and waits for the client to close its end. Bytes that were not read when a connection is closed would
    /// reset it, and the client would lose the answer.
    pub(super) fn end(&self) {
        self.set(Phase::Waiting);
        let _ = self.stream.shutdown(Shutdown::Write);
        let deadline = Instant::now() + FAREWELL;
        let mut ignored = vec![0; PIECE];
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() || self.stream.set_read_timeout(Some(left)).is_err() {
                return;
            }
            match (&self.stream).read(&mut ignored) {
                Ok(0) | Err(_) => return,
                Ok(_) => {}
            }
        }
    }
}

/// All connections, in the order in which they came.
#[derive(Clone, Debug, Default)]
pub(super) struct Connections(Arc<Mutex<Vec<Arc<Connection>>>>);

/// A connection that has a place until this is dropped.
#[derive(Debug)]
pub(super) struct Place {
    pub(super) connection: Arc<Connection>,
    all: Connections,
}

impl Connections {
    fn list(&self) -> MutexGuard<'_, Vec<Arc<Connection>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a client a place, if there is one or if another one can be sent away for it; else returns it.
    pub(super) fn admit(&self, stream: TcpStream) -> std::result::Result<Place, TcpStream> {
        if self.list().len() >= MOST && !self.send_one_away() {
            return Err(stream);
        }
        let connection = Arc::new(Connection::new(stream));
        self.list().push(Arc::clone(&connection));
        Ok(Place { connection, all: self.clone() })
    }

    /// Ends the oldest connection that waits for its client, or else the oldest one whose client has stalled. Returns whether there
    /// was one.
    pub(super) fn send_one_away(&self) -> bool {
        let mut list = self.list();
        let phase = |connection: &Connection| *connection.phase.lock().unwrap_or_else(PoisonError::into_inner);
        let waits = list.iter().position(|other| matches!(phase(other), Phase::Waiting));
        let stalls =
            |other: &Arc<Connection>| matches!(phase(other), Phase::Sending(since) if since.elapsed() > STALLED);
        let Some(at) = waits.or_else(|| list.iter().position(stalls)) else { return false };
        // Its thread finds the connection closed.
        let _ = list.remove(at).stream.shutdown(Shutdown::Both);
        true
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.all.list().retain(|other| !Arc::ptr_eq(other, &self.connection));
    }
}
