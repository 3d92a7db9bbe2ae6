-- Who has asked for which result: where the service asks for keys, an owner sees those of his own. Results stay shared by
-- their content, whoever asked first. Those of jobs are told by the jobs.
CREATE TABLE asked (
    key   BLOB NOT NULL CHECK (length(key) = 32),
    owner TEXT NOT NULL,
    PRIMARY KEY (key, owner)
) STRICT, WITHOUT ROWID;
CREATE TRIGGER asked_as_long_as_kept AFTER DELETE ON results BEGIN
    DELETE FROM asked WHERE key = OLD.key;
END;
