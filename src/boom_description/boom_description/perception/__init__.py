"""An example of a crane perception stack: finds a log in a point cloud and moves the boom to it. Over topics only."""
