"""A class: a folder of submissions, each checked in a process of its own, and its grade book."""
