-- What a job keeps of the disk: its input, and its result, which equal jobs share. With it and with what jobs took an
-- owner's share of the service is told. Programs that know nothing of it can live with it.
ALTER TABLE precut.jobs
    ADD COLUMN input_bytes bigint NOT NULL DEFAULT 0,
    ADD COLUMN result_bytes bigint NOT NULL DEFAULT 0;
UPDATE precut.jobs SET
    input_bytes = octet_length(input),
    result_bytes = CASE WHEN state = 'succeeded'
        THEN coalesce((SELECT bytes FROM precut.results WHERE results.key = jobs.key), 0) ELSE 0 END;
CREATE INDEX jobs_use ON precut.jobs (owner, expires_ms)
    INCLUDE (key, input_bytes, result_bytes, finished_ms, started_ms, estimate_ms);

-- Work of answers that were no jobs, by the minute.
CREATE TABLE precut.work (
    owner  text    NOT NULL,
    minute bigint  NOT NULL,
    ms     double precision NOT NULL,
    PRIMARY KEY (owner, minute)
) WITH (fillfactor = 50);
INSERT INTO precut.versions VALUES (3, 1);
