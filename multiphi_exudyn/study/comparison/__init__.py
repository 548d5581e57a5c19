"""All models of one scene side by side: figures, findings, report."""
