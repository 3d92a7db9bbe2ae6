-- The jobs that wait are the queue. Before this a queue of its own (apalis) told which of them was next: what it knew stands
-- in the jobs' records, so that nothing is lost with it.
DROP TABLE IF EXISTS Jobs;
DROP TABLE IF EXISTS Workers;
DELETE FROM _sqlx_migrations WHERE version > 1000000;
ALTER TABLE precut_jobs DROP COLUMN pushed;
-- Of what waits the next; `heartbeat_ms` of a job that waits says until when somebody keeps others away from it.
DROP INDEX precut_jobs_in_line;
CREATE INDEX precut_jobs_in_line ON precut_jobs (priority DESC, turn, id) WHERE state = 'queued';
