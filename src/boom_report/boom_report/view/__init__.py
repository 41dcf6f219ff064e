"""The moving crane: scene, series and scripts that the live page, the page of a recording and the reports share."""
