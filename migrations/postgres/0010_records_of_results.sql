-- Which machines, tools and materials the job of a result got, as `|machines/lathe-3@4|tools/bar-25@1|`. What programs that
-- do not know of it write is not found by its records.
ALTER TABLE precut.results ADD COLUMN records text NOT NULL DEFAULT '';
CREATE INDEX results_with_records ON precut.results (created_ms, key) INCLUDE (records) WHERE records <> '';
INSERT INTO precut.versions VALUES (10, 9);
