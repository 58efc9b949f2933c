//! The reading end of the event stream: from bytes to [`Event`]s (WHATWG HTML, section 9.2.6).

use std::pin::Pin;

use bytes::Bytes;
use futures::stream::{BoxStream, Stream, StreamExt};
use std::task::{Context, Poll};

use crate::client_error::ClientError;
use crate::{Event, EventBody};

/// Events as they arrive. It ends when the coordinator closes the connection; to go on, open a new stream after the
/// last event that has an `id`.
pub struct EventStream {
    bytes: BoxStream<'static, reqwest::Result<Bytes>>,
    parser: Parser,
    pieces: u64,
}

impl EventStream {
    pub(crate) fn new(response: reqwest::Response) -> Self {
        Self { bytes: response.bytes_stream().boxed(), parser: Parser::default(), pieces: 0 }
    }

    /// How many pieces of the stream have arrived: events, and the comments that a coordinator sends when there are
    /// none. A number that stays the same tells of a stream that is held back on its way.
    pub fn pieces(&self) -> u64 {
        self.pieces
    }
}

impl Stream for EventStream {
    type Item = Result<Event, ClientError>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            if let Some(message) = self.parser.next_message() {
                match serde_json::from_slice::<EventBody>(&message.data) {
                    Ok(body) => return Poll::Ready(Some(Ok(Event { id: message.id, body }))),
                    // A newer coordinator may send kinds of events that this build does not know.
                    Err(_) => continue,
                }
            }
            match self.bytes.poll_next_unpin(context) {
                Poll::Ready(Some(Ok(bytes))) => {
                    self.pieces += 1;
                    self.parser.push(&bytes);
                }
                Poll::Ready(Some(Err(error))) => return Poll::Ready(Some(Err(error.into()))),
                Poll::Ready(None) => return Poll::Ready(None),
                Poll::Pending => return Poll::Pending,
            }
        }
    }
}

/// Splits the stream into messages. The coordinator ends lines with `\n` and never splits `data:` over lines within a
/// JSON text, but both forms are read.
#[derive(Default)]
struct Parser {
    buffer: Vec<u8>,
}

struct Message {
    id: Option<i64>,
    data: Vec<u8>,
}

impl Parser {
    fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend(bytes.iter().filter(|byte| **byte != b'\r'));
    }

    /// The next message that has data; comments and empty messages are skipped.
    fn next_message(&mut self) -> Option<Message> {
        loop {
            let end = self.buffer.windows(2).position(|pair| pair == b"\n\n")?;
            let block: Vec<u8> = self.buffer.drain(..end + 2).collect();
            let mut message = Message { id: None, data: Vec::new() };
            for line in block.split(|byte| *byte == b'\n') {
                if let Some(data) = field(line, b"data") {
                    message.data.extend_from_slice(data);
                } else if let Some(id) = field(line, b"id") {
                    message.id = std::str::from_utf8(id).ok().and_then(|id| id.parse().ok());
                }
            }
            if !message.data.is_empty() {
                return Some(message);
            }
        }
    }
}

fn field<'a>(line: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let value = line.strip_prefix(name)?.strip_prefix(b":")?;
    Some(value.strip_prefix(b" ").unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_split_anywhere_are_put_together_and_comments_skipped() {
        let text = b": keep alive\n\nevent: job\nid: 7\ndata: {\"a\":1}\n\nid: 8\r\ndata:{\"b\":2}\r\n\r\n";
        for cut in 0..text.len() {
            let mut parser = Parser::default();
            let mut found = Vec::new();
            for piece in [&text[..cut], &text[cut..]] {
                parser.push(piece);
                while let Some(message) = parser.next_message() {
                    found.push((message.id, String::from_utf8(message.data).unwrap()));
                }
            }
            assert_eq!(found, [(Some(7), "{\"a\":1}".to_owned()), (Some(8), "{\"b\":2}".to_owned())], "cut at {cut}");
        }
    }
}
