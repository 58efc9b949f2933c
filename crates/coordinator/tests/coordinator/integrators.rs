//! What a farm says about integrators, and what becomes of a scene that names one or none.

use clerestory_api::ProblemCode;
use serde_json::json;

use crate::support::*;

#[tokio::test(flavor = "multi_thread")]
async fn integrators_are_listed_with_schemas_and_a_scene_without_one_gets_the_default() {
    let farm = TestFarm::start().await;
    let listed = farm.client.integrators().await.unwrap();
    let default = listed.iter().find(|integrator| integrator.is_default).unwrap();
    assert_eq!(default.name, "auto");
    let fnee = listed.iter().find(|integrator| integrator.name == "fnee").unwrap();
    assert_eq!(fnee.schema["properties"]["max_trials"]["maximum"], 1_000_000);
    assert_eq!(fnee.defaults["max_trials"], 1000);

    let mut submission = submission(1);
    submission.scene.as_object_mut().unwrap().remove("integrator");
    submission.scene["panes"] = json!([{
        "name": "pane", "centre": [0, 0, -1], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0], "width": 0.5, "height": 0.5,
        "thickness": 0.003, "index_of_refraction": 1.5, "front": "flat", "back": "flat"
    }]);
    let job = farm.client.submit_job(&submission).await.unwrap();
    assert_eq!(job.integrator, "auto");
    for integrator in &listed {
        submission.scene["integrator"] = json!(integrator.name);
        let by_name = farm.client.submit_job(&submission).await.unwrap();
        submission.scene["integrator"] = json!({ integrator.name.as_str(): integrator.defaults });
        let with_settings = farm.client.submit_job(&submission).await.unwrap();
        assert_eq!((&by_name.integrator, &by_name.scene_hash), (&integrator.name, &with_settings.scene_hash));
    }
    submission.scene["integrator"] = json!("magic");
    let error = farm.client.submit_job(&submission).await.unwrap_err();
    let problem = error.problem().unwrap();
    assert_eq!(problem.code, ProblemCode::InvalidScene);
    assert!(problem.detail.contains("expected one of `auto`"), "{problem:?}");
    farm.stop().await;
}
