"""Places on the globe, as people write them."""


def lon_lat(text: str) -> tuple[float, float]:
    """LON,LAT as numbers; ValueError for another text."""
    try:
        lon, lat = (float(each) for each in text.split(","))
    except ValueError:
        raise ValueError(f"the centre is {text!r}: give LON,LAT, two numbers of degrees") from None
    return lon, lat
