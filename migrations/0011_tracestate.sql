-- What the systems on a trace's way say of it (W3C Trace Context, section 3.3), beside where the request belongs in it.
ALTER TABLE precut_jobs ADD COLUMN tracestate TEXT;
