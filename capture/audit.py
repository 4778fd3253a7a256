def audit(session, frames, exif, *, facts, ambient_exif=()):
    return ()
