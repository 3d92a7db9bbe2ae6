//! Who may see what, where everything is in PostgreSQL: the checks that a service over SQLite passes.

use precut::config::Config;
use precut::registry::Registry;
use reqwest::Method;
use serde_json::Value;

use crate::database::{Database, until};
use crate::isolation::{self, As};
use crate::support::{Server, toy};

async fn server(registry: Registry, database: &Database) -> Server {
    let store = database.address.parse().unwrap();
    Server::start_of(registry, |config: &mut Config| {
        isolation::with_keys(config);
        config.store = store;
    })
    .await
}

#[tokio::test]
async fn the_things_of_an_owner_are_his_alone() {
    let Some(database) = Database::start() else { return };
    let server = server(toy::registry(), &database).await;
    isolation::jobs_are_their_owners_alone(&server).await;
    isolation::an_answer_is_traced_to_what_made_it(&server).await;
    server.stop().await;
    let server = self::server(Registry::standard().unwrap(), &database).await;
    isolation::models_are_their_owners_alone(&server).await;
    isolation::an_answer_is_traced_to_its_model(&server).await;
    isolation::records_are_their_owners_alone(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn results_are_shared_by_content_and_shown_to_who_asked() {
    let Some(database) = Database::start() else { return };
    let server = server(toy::registry(), &database).await;
    isolation::results_are_shared_by_content_and_shown_to_who_asked(&server).await;
    server.stop().await;
}

#[tokio::test]
async fn what_one_process_stores_every_other_one_means_within_a_second() {
    let Some(database) = Database::start() else { return };
    let (one, other) = (
        server(Registry::standard().unwrap(), &database).await,
        server(Registry::standard().unwrap(), &database).await,
    );
    let (here, there) = (As(&one, "a-one"), As(&other, "a-one"));
    let job = serde_json::json!({
        "machine": "lathe-3", "material": "steel_45",
        "shaft": {"segments": [{"length_mm": 500, "diameter_mm": 60, "stock_diameter_mm": 62}]},
        "supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "centre", "z_mm": 500}],
        "force": {"kind": "constant", "passive_n": 200},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
    });
    for (revision, carriage) in [(1, 0.02), (2, 0.07)] {
        let set = serde_json::json!({ "/compliance/carriage_um_per_n": carriage });
        let record = serde_json::json!({ "from": "lathe_engine_medium", "set": set });
        let put = here.request(Method::PUT, "/v1/machines/lathe-3").json(&record).send().await.unwrap();
        assert_eq!(put.json::<Value>().await.unwrap()["revision"], revision);
        let asked = async |caller: &As<'_>, job: &Value| -> Value {
            let answer = caller.request(Method::POST, "/v1/deflection-compensation").json(job).send().await.unwrap();
            answer.json().await.unwrap()
        };
        // Where it was stored it holds at once, by its number everywhere; elsewhere it is waited for.
        assert_eq!(asked(&here, &job).await["resources"]["machine"]["revision"], revision);
        let exact = serde_json::json!({ "machine": format!("lathe-3@{revision}") });
        let mut by_number = job.clone();
        by_number["machine"] = exact["machine"].clone();
        assert_eq!(asked(&there, &by_number).await["resources"]["machine"]["revision"], revision);
        until("the other process to mean the new revision", async || {
            (asked(&there, &job).await["resources"]["machine"]["revision"] == revision).then_some(())
        })
        .await;
    }
    one.stop().await;
    other.stop().await;
}
