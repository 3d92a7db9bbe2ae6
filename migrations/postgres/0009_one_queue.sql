-- The jobs that wait are the queue. Before this a queue of its own (apalis, in a schema of that name) told which of them was
-- next: what it knew stands in the jobs' records, so that nothing is lost with it. Where others use that schema, it stays
-- without what was ours. The extensions that it needed (hstore, pgcrypto) are left alone: others may use them as well.
DO $$
BEGIN
    IF to_regclass('apalis.jobs') IS NULL THEN
        RETURN;
    END IF;
    IF EXISTS (SELECT FROM apalis.jobs WHERE NOT starts_with(job_type, 'precut/'))
        OR EXISTS (SELECT FROM apalis.workers WHERE NOT starts_with(worker_type, 'precut/')) THEN
        DELETE FROM apalis.jobs WHERE starts_with(job_type, 'precut/');
        DELETE FROM apalis.workers WHERE starts_with(worker_type, 'precut/');
        RETURN;
    END IF;
    DROP SCHEMA apalis CASCADE;
END $$;

ALTER TABLE precut.jobs
    DROP COLUMN pushed,
    -- So many others are wanted to compute parts of it.
    ADD COLUMN help integer NOT NULL DEFAULT 0;
-- Of what waits the next; `heartbeat_ms` of a job that waits says until when somebody keeps others away from it.
DROP INDEX precut.jobs_in_line;
CREATE INDEX jobs_in_line ON precut.jobs (priority DESC, turn, id) WHERE state = 'queued';
CREATE INDEX jobs_want_help ON precut.jobs (priority DESC, turn, id) WHERE state = 'running' AND help > 0;

-- Whoever has a place hears of it, whatever brought the job into line.
CREATE FUNCTION precut.job_waits() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    PERFORM pg_notify('precut_news', '{"waiting":true}');
    RETURN NULL;
END $$;
CREATE TRIGGER jobs_wait AFTER INSERT OR UPDATE OF state ON precut.jobs FOR EACH ROW
    WHEN (NEW.state = 'queued') EXECUTE FUNCTION precut.job_waits();

-- Processes that run jobs, and of which version.
CREATE TABLE precut.workers (
    id      text   NOT NULL PRIMARY KEY,
    engine  text   NOT NULL,
    seen_ms bigint NOT NULL
) WITH (fillfactor = 50);
-- Programs before this look for their jobs in a queue that is gone.
INSERT INTO precut.versions VALUES (9, 9);
