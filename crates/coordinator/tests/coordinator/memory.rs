//! What a submission may cost a coordinator.

use std::time::Duration;

use bytes::Bytes;
use clerestory_api::{Client, ClientError, JobSubmission, JobView, Problem, ProblemCode};
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

use crate::support::*;

#[track_caller]
fn refused(answer: Result<JobView, ClientError>, field: &str) -> Problem {
    let failure = answer.unwrap_err();
    let problem = failure.problem().unwrap_or_else(|| panic!("{failure}")).clone();
    assert_eq!((problem.status, problem.code), (422, ProblemCode::InvalidScene), "{problem}");
    assert_eq!(problem.field.as_deref(), Some(field), "{problem}");
    problem
}

/// A submission whose mesh comes from elsewhere.
fn with_source(source: Value) -> JobSubmission {
    let mut scene = scene();
    scene["meshes"][0]["source"] = source;
    JobSubmission { scene, ..submission(1) }
}

fn waves(cells: u32) -> Value {
    json!({"waves": {"size": [1, 1], "cells": [cells, cells], "wavelengths": [0.1, 0.2], "height": 0.01, "seed": 1}})
}

async fn with_asset(client: &Client, submission: JobSubmission, name: &str, content: Vec<u8>) -> JobSubmission {
    let content = Bytes::from(content);
    let hash = hash(&content);
    client.upload_asset(&hash, content, |_| ()).await.unwrap();
    JobSubmission { assets: [(name.to_owned(), hash)].into(), ..submission }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_that_takes_much_memory_to_build_is_accepted_in_little() {
    let farm = TestFarm::start_with(|config| config.submission_bytes = 1 << 20).await;
    farm.client.submit_job(&with_source(waves(3162))).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn files_that_would_not_even_fit_as_they_are_are_not_read() {
    let farm = TestFarm::start_with(|config| config.submission_bytes = 1 << 20).await;
    let obj = with_source(json!({"obj": {"file": "a.obj"}}));
    let obj = with_asset(&farm.client, obj, "a.obj", vec![b'\n'; 2 << 20]).await;
    let failure = farm.client.submit_job(&obj).await.unwrap_err();
    let problem = failure.problem().unwrap();
    assert_eq!((problem.status, problem.field.as_deref()), (422, Some("assets")), "{problem}");
    assert!(problem.value.as_ref().unwrap().contains("2097152 bytes"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_of_more_than_any_has_is_refused_with_the_number() {
    let farm = TestFarm::start().await;
    let mut lakes = scene();
    lakes["meshes"] = (0..8)
        .map(|index| json!({"name": format!("lake {index}"), "material": "stone", "source": waves(4096)}))
        .collect();
    let submitted = farm.client.submit_job(&JobSubmission { scene: lakes, ..submission(1) }).await;
    refused(submitted, "scene.meshes");

    // A picture of 16384 pixels by 16384, all black, is a small file. What its header says is enough.
    let mut header = b"IHDR\0\0\x40\0\0\0\x40\0\x08\x02\0\0\0".to_vec();
    header.extend(crc32(&header).to_be_bytes());
    let picture = [&b"\x89PNG\r\n\x1a\n\0\0\0\x0d"[..], &header].concat();
    let mut textured = scene();
    textured["materials"]["stone"] = json!({"diffuse": {"reflectance": {"texture": {"file": "black.png"}}}});
    textured["meshes"][0]["source"]["inline"]["texture_coordinates"] = json!([[0, 0], [1, 0], [1, 1], [0, 1]]);
    let submitted = JobSubmission { scene: textured, ..submission(1) };
    let submitted = with_asset(&farm.client, submitted, "black.png", picture).await;
    let problem = refused(farm.client.submit_job(&submitted).await, "scene.materials");
    assert!(problem.value.unwrap().contains("268435456 texels"));
    farm.stop().await;
}

/// The checksum of a PNG chunk (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 })
    };
    !bytes.iter().fold(u32::MAX, step)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_does_not_wait_for_others_that_stop_on_their_way() {
    let farm = TestFarm::start().await;
    let mut stopped = Vec::new();
    for _ in 0..8 {
        let mut connection = TcpStream::connect(farm.address.trim_start_matches("http://")).await.unwrap();
        let head = "POST /api/v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
                    transfer-encoding: chunked\r\n\r\n1\r\n{\r\n";
        connection.write_all(head.as_bytes()).await.unwrap();
        stopped.push(connection);
    }
    let submitted = tokio::time::timeout(Duration::from_secs(4), farm.client.submit_job(&submission(1))).await;
    submitted.expect("it waits for nobody").unwrap();
    drop(stopped);
    farm.stop().await;
}
