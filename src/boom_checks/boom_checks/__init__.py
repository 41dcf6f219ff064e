"""What can be said of a recording before any search: is it to be trusted, what do its levels say, which link breaks."""
