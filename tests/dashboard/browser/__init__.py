"""The dashboard in a browser: a package, whose tests share one, and others not, since its loop would disturb them."""
