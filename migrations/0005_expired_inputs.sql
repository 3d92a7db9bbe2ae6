-- The inputs of jobs that nobody may ask for any more are found without a look at the records that outlive them.
CREATE INDEX precut_jobs_by_expiry_of_input ON precut_jobs (expires_ms)
    WHERE expires_ms IS NOT NULL AND length(input) > 0;
