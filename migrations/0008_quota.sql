-- What a job keeps of the disk: its input, and its result, which equal jobs share. With it and with what jobs took an
-- owner's share of the service is told.
ALTER TABLE precut_jobs ADD COLUMN input_bytes INTEGER NOT NULL DEFAULT 0;
ALTER TABLE precut_jobs ADD COLUMN result_bytes INTEGER NOT NULL DEFAULT 0;
UPDATE precut_jobs SET
    input_bytes = length(input),
    result_bytes = iif(state = 'succeeded', coalesce((SELECT bytes FROM results WHERE results.key = precut_jobs.key), 0), 0);
-- Covers both sums.
CREATE INDEX precut_jobs_use
    ON precut_jobs (owner, expires_ms, key, input_bytes, result_bytes, finished_ms, started_ms, estimate_ms);

-- Work of answers that were no jobs, by the minute.
CREATE TABLE work (
    owner  TEXT    NOT NULL,
    minute INTEGER NOT NULL,
    ms     REAL    NOT NULL,
    PRIMARY KEY (owner, minute)
) STRICT, WITHOUT ROWID;
