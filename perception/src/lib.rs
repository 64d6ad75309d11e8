//! sinew-perception
