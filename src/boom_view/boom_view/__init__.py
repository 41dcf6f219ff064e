"""The crane moving in a browser: a recording, or the running machine with the model beside it."""
