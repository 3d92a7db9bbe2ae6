//! Who may see what, where everything is in PostgreSQL: the checks that a service over SQLite passes.

use precut::config::Config;
use precut::registry::Registry;

use crate::database::Database;
use crate::isolation;
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
    server.stop().await;
}

#[tokio::test]
async fn results_are_shared_by_content_and_shown_to_who_asked() {
    let Some(database) = Database::start() else { return };
    let server = server(toy::registry(), &database).await;
    isolation::results_are_shared_by_content_and_shown_to_who_asked(&server).await;
    server.stop().await;
}
