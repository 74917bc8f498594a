# The minimum convex polygons of adehabitatHR. Called by mcp.py: Rscript mcp.R FOLDER
#
# FOLDER/points holds a table of doubles, x and y in turn; FOLDER/percents the percentages. The polygons go to
# FOLDER/polygons, each as the number of its corners and their coordinates; times and versions to standard output.
suppressPackageStartupMessages(library(adehabitatHR))

folder <- commandArgs(trailingOnly = TRUE)[1]
doubles <- function(name) {
  file <- file.path(folder, name)
  readBin(file, "double", n = file.size(file) / 8)
}
points <- SpatialPoints(matrix(doubles("points"), ncol = 2, byrow = TRUE))
out <- file(file.path(folder, "polygons"), "wb")
for (percent in doubles("percents")) {
  seconds <- system.time(polygon <- mcp(points, percent, unout = "m2"))[["elapsed"]]
  corners <- polygon@polygons[[1]]@Polygons[[1]]@coords
  writeBin(c(nrow(corners), t(corners)), out)
  cat(seconds, "\n")
}
close(out)
cat(R.version.string, "with adehabitatHR", as.character(packageVersion("adehabitatHR")), "\n")
