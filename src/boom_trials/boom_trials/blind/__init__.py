"""The blind trial: physics is concealed in a second plant, a diagnosis that cannot see the answers looks for it, and is scored."""
