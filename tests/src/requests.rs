//! Where HTTP/1.1 requests end: as much of the protocol as it takes to tell one from the next on a connection.

use std::io;

use tokio::io::{AsyncRead, AsyncReadExt};

/// What ends the head of a request, and each of its lines.
const LINE: &[u8] = b"\r\n";

/// Reads the next request, head and body, as it was sent; `None` at the end of the connection. `waiting` holds what was
/// read beyond it.
///
/// # Errors
///
/// When the connection fails or ends in the middle of a request, or the data is no request.
pub(crate) async fn read_request(
    connection: &mut (impl AsyncRead + Unpin),
    waiting: &mut Vec<u8>,
) -> io::Result<Option<Vec<u8>>> {
    loop {
        if let Some(length) = length(waiting)? {
            let rest = waiting.split_off(length);
            return Ok(Some(std::mem::replace(waiting, rest)));
        }
        if connection.read_buf(waiting).await? == 0 {
            return if waiting.is_empty() { Ok(None) } else { Err(io::ErrorKind::UnexpectedEof.into()) };
        }
    }
}

/// How long the first request is; `None` when not all of it is there.
fn length(bytes: &[u8]) -> io::Result<Option<usize>> {
    let Some(head) = find(bytes, b"\r\n\r\n") else { return Ok(None) };
    let body = head + 4;
    let wrong = || io::Error::new(io::ErrorKind::InvalidData, "not a request that this proxy understands");
    let text = str::from_utf8(&bytes[..head]).map_err(|_| wrong())?;
    for line in text.split("\r\n").skip(1) {
        let (name, value) = line.split_once(':').ok_or_else(wrong)?;
        if name.eq_ignore_ascii_case("content-length") {
            let length: usize = value.trim().parse().map_err(|_| wrong())?;
            return Ok(Some(body.saturating_add(length)).filter(|end| *end <= bytes.len()));
        }
        if name.eq_ignore_ascii_case("transfer-encoding") {
            return chunks(bytes, body).map_err(|()| wrong());
        }
    }
    Ok(Some(body))
}

/// Where a body in chunks ends that begins at `start`.
fn chunks(bytes: &[u8], mut start: usize) -> Result<Option<usize>, ()> {
    loop {
        let Some(line) = bytes.get(start..).and_then(|rest| find(rest, LINE)) else { return Ok(None) };
        let size = str::from_utf8(&bytes[start..start + line]).map_err(|_| ())?;
        let size = size.split(';').next().unwrap_or_default().trim();
        let size = usize::from_str_radix(size, 16).map_err(|_| ())?;
        start = (start + line + LINE.len()).saturating_add(size).saturating_add(LINE.len());
        if size == 0 {
            return Ok(Some(start).filter(|end| *end <= bytes.len()));
        }
    }
}

fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes.windows(wanted.len()).position(|window| window == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_told_apart_however_their_bodies_are_framed() {
        let requests = [
            "GET /a HTTP/1.1\r\nhost: b\r\n\r\n",
            "PUT /a HTTP/1.1\r\nContent-Length: 7\r\n\r\nabc\r\n\r\n",
            "PUT /a HTTP/1.1\r\ntransfer-encoding: chunked\r\n\r\n3\r\na\r\n\r\nb;c=d\r\n0123456789a\r\n0\r\n\r\n",
            "POST /a HTTP/1.1\r\ncontent-length: 0\r\n\r\n",
        ];
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(async {
            let all = requests.concat();
            let (mut connection, mut waiting) = (all.as_bytes(), Vec::new());
            for request in requests {
                let read = read_request(&mut connection, &mut waiting).await.unwrap().unwrap();
                assert_eq!(String::from_utf8(read).unwrap(), request);
            }
            assert_eq!(read_request(&mut connection, &mut waiting).await.unwrap(), None);
        });
    }

    #[test]
    fn a_request_that_is_cut_off_or_none_is_an_error() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        for bytes in ["PUT /a HTTP/1.1\r\ncontent-length: 7\r\n\r\nabc", "PUT /a HTTP/1.1\r\nlead\r\n\r\n"] {
            let read = runtime.block_on(read_request(&mut bytes.as_bytes(), &mut Vec::new()));
            assert!(read.is_err(), "{bytes}");
        }
    }
}
