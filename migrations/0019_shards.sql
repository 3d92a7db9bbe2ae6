-- A shard of a large study is a job of its own, in the same line. `parent` is the key of the study, so that equal studies share
-- their shards; `content` is what the shard came to (zstd with a checksum). No owner has it, and no list shows it.
ALTER TABLE jobs ADD COLUMN parent BLOB CHECK (parent IS NULL OR length(parent) = 32);
ALTER TABLE jobs ADD COLUMN shard INTEGER CHECK ((shard IS NULL) = (parent IS NULL));
ALTER TABLE jobs ADD COLUMN content BLOB;
DROP INDEX precut_jobs_by_state;
CREATE INDEX precut_jobs_by_state ON jobs (state, parent, id);
CREATE INDEX jobs_of_parent ON jobs (parent, state, id) WHERE parent IS NOT NULL;
-- A study ends in many ways, and with the last of equal ones its shards go.
CREATE TRIGGER shards_of_what_is_over AFTER UPDATE OF state ON jobs
WHEN NEW.parent IS NULL AND NEW.state IN ('succeeded', 'failed', 'cancelled') BEGIN
    DELETE FROM jobs WHERE parent = OLD.key AND NOT EXISTS (
        SELECT 1 FROM jobs AS other WHERE other.key = OLD.key AND other.state IN ('queued', 'running'));
END;
-- The parts that earlier programs kept beside the jobs. Their points are kept as results and are not computed again.
DROP TABLE studies;
