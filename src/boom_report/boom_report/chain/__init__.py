"""Report and terminal output of the chain: doubts about the recording, links, statics, the valve at the cylinder."""
