"""Where examples come from: tasks that several studies share."""
