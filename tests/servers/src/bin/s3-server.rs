//! A server that speaks S3 over a folder, whose folders are the buckets, until it is interrupted.
//!
//! `s3-server FOLDER PORT ACCESS_KEY SECRET_KEY`

use std::error::Error;

use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto::Builder;
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use tokio::net::TcpListener;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, port, access_key, secret_key] = &arguments[..] else {
        return Err("usage: s3-server FOLDER PORT ACCESS_KEY SECRET_KEY".into());
    };
    let files = FileSystem::new(folder).map_err(|error| format!("cannot use the folder {folder}: {error:?}"))?;
    let mut service = S3ServiceBuilder::new(files);
    service.set_auth(SimpleAuth::from_single(access_key.as_str(), secret_key.as_str()));
    let service = service.build();
    let listener = TcpListener::bind(("127.0.0.1", port.parse()?)).await?;
    // A shell that runs it in the background has told it to ignore interrupts.
    tokio::select! {
        served = serve(listener, service) => served,
        interrupted = tokio::signal::ctrl_c() => Ok(interrupted?),
    }
}

async fn serve(listener: TcpListener, service: s3s::service::S3Service) -> Result<(), Box<dyn Error>> {
    let server = Builder::new(TokioExecutor::new());
    loop {
        let (socket, _) = listener.accept().await?;
        let connection = server.serve_connection(TokioIo::new(socket), service.clone()).into_owned();
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                eprintln!("a connection failed: {error}");
            }
        });
    }
}
