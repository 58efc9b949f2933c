//! A database that the first build has left in the middle of a job, and what becomes of the job.

use clerestory_api::{ConvergencePoint, JobId, JobState};
use clerestory_film::NodeAddress;
use clerestory_test_servers::postgres;

use crate::model::Work;
use crate::store::engine::schema::{APPLIED, MIGRATIONS};
use crate::store::engine::source::Source;
use crate::store::engine::sql::query;
use crate::store::tests::{Farm, pins};

/// A job of two passes over two tiles. Of the first pass, one tile has been accepted, and a worker has the other;
/// another job is done.
const LEFT: &str = r#"
    insert into jobs (id, name, state, priority, scene, scene_hash, integrator, missing_light, frames, width,
        height, tile_size,
        samples_per_pass, samples_per_block, passes, created_ms, started_ms, cursor_round, accepted_nodes, samples,
        core_ms)
        values ('01900000-0000-7000-8000-000000000001', 'window', 'running', 0, '{}', 'h', 'path', '[]', 1, 32, 16,
        16, 4, 64, 2, 5, 10, 1, 1, 1024, 100);
    insert into jobs (id, name, state, priority, scene, scene_hash, integrator, missing_light, frames, width,
        height, tile_size,
        samples_per_pass, samples_per_block, passes, created_ms, started_ms, finished_ms, cursor_round, rounds,
        complete_passes, accepted_nodes, samples)
        values ('01900000-0000-7000-8000-000000000002', 'done', 'done', 0, '{}', 'h', 'path', '[]', 1, 16, 16, 16,
        4, 64, 1, 1, 2, 3, 1, 1, 1, 1, 1024);
    insert into workers (id, name, cores, build, registered_ms, seen_ms, accepted_nodes, samples, core_ms)
        values ('01900000-0000-7000-8000-000000000003', 'w', 2, 'b', 1, 20, 1, 1024, 100);
    insert into rates (worker, job, samples, core_ms)
        values ('01900000-0000-7000-8000-000000000003', '01900000-0000-7000-8000-000000000001', 1024, 100);
    insert into leases (id, token, job, worker, state, nodes, granted_ms, deadline_ms)
        values ('01900000-0000-7000-8000-000000000004', 7, '01900000-0000-7000-8000-000000000001',
        '01900000-0000-7000-8000-000000000003',
        'active', '[[0,0,0,0],[0,1,0,0]]', 10, 1000);
    insert into waves (job, frame, round, end_pass, outstanding,
        core_ms) values ('01900000-0000-7000-8000-000000000001', 0, 0, 1, 1, 100);
    insert into pending (job, round, frame, tile, level, idx, failures, lease)
        values ('01900000-0000-7000-8000-000000000001', 0, 0, 1, 0, 0, 3, '01900000-0000-7000-8000-000000000004');
    insert into nodes (job, frame, tile, level, idx, first_pass, end_pass, blob)
        values ('01900000-0000-7000-8000-000000000001', 0, 0, 0, 0, 0, 1, 'first'),
        ('01900000-0000-7000-8000-000000000002', 0, 0, 0, 0, 0, 1, 'second');
    insert into rounds (job, frame, round, passes, samples_per_pixel, core_ms, wall_ms, recorded_ms, mse)
        values ('01900000-0000-7000-8000-000000000002', 0, 0, 1, 4, 50, 1, 3, 0.25);
    insert into events (id, kind, job, created_ms) values (1, 'job', '01900000-0000-7000-8000-000000000001', 5);
    update sequences set value = 7 where name = 'fencing_token';
    update sequences set value = 1 where name = 'event';
"#;

/// Leaves a database as the first build did.
async fn leave(source: &Source) {
    let mut connection = source.writer().await.unwrap();
    let (version, name, statements) = MIGRATIONS[0];
    query(APPLIED).execute(&mut connection).await.unwrap();
    connection.batch(statements).await.unwrap();
    connection.batch(LEFT).await.unwrap();
    let applied = "insert into _sqlx_migrations (version, description, success, checksum, execution_time) values \
                   ($1, $2, true, '', 0)";
    query(applied).bind(version).bind(name).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

async fn in_both(check: impl AsyncFn(Source)) {
    let directory = tempfile::tempdir().unwrap();
    check(Source::file(&directory.path().join("farm.sqlite"))).await;
    check(Source::postgres(&postgres().new_database().parse().unwrap()).unwrap()).await;
}

async fn a_job_goes_on_that_the_first_build_has_begun(source: Source) {
    leave(&source).await;
    let farm = Farm::at(source, None).await;
    let [job, done]: [JobId; 2] = [1, 2].map(|number| format!("01900000-0000-7000-8000-{number:012}").parse().unwrap());
    let record = farm.record(done).await;
    assert_eq!((record.state, record.stopped_by.map(|reason| reason.name())), (JobState::Done, Some("samples")));
    let points = farm.store.convergence(done).await.unwrap();
    assert_eq!(
        points.iter().map(|point| (point.core_ms, point.mse, point.flip)).collect::<Vec<_>>(),
        [(50, Some(0.25), None)]
    );

    let nodes = farm.store.nodes(job, 0, 0..2, u32::MAX).await.unwrap();
    let [node] = nodes.as_slice() else { panic!("{nodes:?}") };
    assert_eq!(node.address, NodeAddress { frame: 0, tile: 0, level: 0, index: 0 });
    assert_eq!((node.blob_range.blob.as_str(), node.blob_range.offset, node.blob_range.length), ("first", 0, None));
    assert_eq!(node.work, Work::default(), "nobody counted");
    assert_eq!(farm.expire(2000).await, 1);
    let worker = farm.worker_named("another").await.unwrap();
    let mut tokens = Vec::new();
    while let Some(grant) = farm.claim(worker, 1, 2000).await {
        tokens.push(grant.lease.token);
        farm.deliver(&grant, &grant.nodes, 2000).await.unwrap();
    }
    assert_eq!(tokens, [8, 9, 10], "tokens rise, and what was accepted is not rendered again");
    for round in 0..2 {
        assert!(farm.next_complete_round(job).await.is_some(), "round {round} is not complete");
        let point = ConvergencePoint { round, ..ConvergencePoint::default() };
        farm.store.record_round(&farm.record(job).await, vec![point], 2000).await.unwrap().unwrap();
    }
    let record = farm.record(job).await;
    assert_eq!((record.state, record.samples), (JobState::Done, record.total_samples()));
}

#[tokio::test]
async fn a_job_goes_on_that_the_first_build_has_begun_in_both_databases() {
    in_both(a_job_goes_on_that_the_first_build_has_begun).await;
}

async fn a_job_of_many_lights_stays_with_the_first_build(source: Source) {
    leave(&source).await;
    let mut connection = source.writer().await.unwrap();
    let five = r#"{"lights": [{}, {}, {}, {}, {}]}"#;
    query("update jobs set scene = $1 where state = 'running'").bind(five).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();

    let farm = Farm::at(source, None).await;
    assert_eq!(farm.expire(2000).await, 1);
    let older = pins::worker(&farm, "older", "first", &[]).await;
    assert!(farm.claim(older, 1, 2000).await.is_some());
    let newer = pins::worker(&farm, "newer", "first", &[("path", &["p"])]).await;
    assert!(farm.claim(newer, 1, 2000).await.is_none(), "it would choose among the lights");
}

#[tokio::test]
async fn a_job_of_many_lights_stays_with_the_first_build_in_both_databases() {
    in_both(a_job_of_many_lights_stays_with_the_first_build).await;
}
