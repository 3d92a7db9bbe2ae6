-- Tables have the names that they have in PostgreSQL, where the same statements work with them. The queue that had a table
-- `Jobs` of its own is gone since 0014.
ALTER TABLE precut_jobs RENAME TO jobs;
