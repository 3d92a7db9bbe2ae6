-- Which machines, tools and materials the job of a result got, as `|machines/lathe-3@4|tools/bar-25@1|`.
ALTER TABLE results ADD COLUMN records TEXT NOT NULL DEFAULT '';
-- Covers the list of those that got a record, and their count.
CREATE INDEX results_with_records ON results (created_ms, key, calculator, version, engine, bytes, records)
    WHERE records <> '';
