"""The contrast of two colours (WCAG), as a browser computes it."""

CONTRAST = """([over, under]) => {
    const rgb = colour => colour.startsWith("#") ? colour.match(/[0-9a-f]{2}/gi).map(each => parseInt(each, 16))
        : colour.match(/[0-9.]+/g).slice(0, 3)
    const light = colour => rgb(colour).map(each => each / 255)
        .map(each => each <= 0.04045 ? each / 12.92 : ((each + 0.055) / 1.055) ** 2.4)
        .reduce((sum, each, i) => sum + each * [0.2126, 0.7152, 0.0722][i], 0)
    const [low, high] = [light(over), light(under)].sort((one, two) => one - two)
    return (high + 0.05) / (low + 0.05)
}"""
