"""The blind trial: physics concealed in a second plant, found (or not) by a diagnosis that cannot see the answers, scored."""
