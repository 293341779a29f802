//! High spatial frequency error and the centroids of pixel windows.
#![forbid(unsafe_code)]
